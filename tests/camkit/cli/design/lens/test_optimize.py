import json
from dataclasses import replace
from pathlib import Path

import pytest

from camkit.models_def.optics.analysis.focus_note import focus_note
from camkit.models_def.optics.focus import with_focus
from camkit.models_def.optics.lens_file.lens_file import read_lens, write_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import with_focus_shift

PRESCRIPTIONS = Path(__file__).resolve().parents[5] / "models_def" / "prescriptions"
SPOTS = ("spot_rms_mm_before", "spot_rms_mm_after")
QUICK = ("--starts", "2", "--steps", "20", "--rays", "8")


def test_a_better_lens_of_the_same_focal_length_is_written(camkit_command, tmp_path: Path) -> None:
    source, out = PRESCRIPTIONS / "cooke-triplet.toml", tmp_path / "better.zmx"
    command = ("lens", "optimize", source, "-o", out, "--vary", "curvature,thickness", *QUICK)
    outcome = camkit_command(*command, "--json")
    assert outcome.code == 0, outcome.err
    report = json.loads(outcome.out)
    assert report["merit_after"] < 0.95 * report["merit_before"] < 0.02, "spots alone, no limits"
    assert max(report["spot_rms_mm_after"]) < 0.9 * max(report["spot_rms_mm_before"])
    assert report["variables"] == 11
    kept = paraxial_data(read_lens(source)).efl_mm
    assert paraxial_data(read_lens(out)).efl_mm == pytest.approx(kept, rel=1e-6)
    rims = [[s.semi_diameter_mm for s in read_lens(path).surfaces] for path in (source, out)]
    assert rims[0] == rims[1], "rims stay"
    limit, *others = report["notes"]
    assert limit == f"on the limit of its range: {', '.join(report['on_limits'])}"
    assert report["on_limits"] == ["thickness of surface 2 = 1 mm"]
    assert all("the beam needs" in note for note in others)


def test_what_refocusing_alone_gains_is_said(camkit_command, tmp_path: Path) -> None:
    """A sensor 3 mm off at F/4: spots of 3 / 4 / 2 / sqrt(2) mm."""
    source, out = tmp_path / "far.toml", tmp_path / "better.toml"
    lens = with_focus(read_lens(PRESCRIPTIONS / "cooke-triplet.toml"), "spot")
    write_lens(with_focus_shift(lens, -3.0), source)
    command = ("lens", "optimize", source, "-o", out, "--vary", "conic", "--overwrite")
    short = ("--starts", "1", "--steps", "1", "--rays", "8")
    report = json.loads(camkit_command(*command, *short, "--json").out)
    before, after = report["spot_rms_mm_before"], report["spot_rms_mm_refocused"]
    assert before[0] == pytest.approx(3 / 8 / 2**0.5, rel=0.05)
    assert max(after) < 0.03
    note = "the sensor is out of focus: 3 mm farther from the lens the RMS spot over all fields is"
    told = camkit_command(*command, *short)
    assert note in told.err
    spots = f"0 degrees {1000 * before[0]:.1f} -> {1000 * after[0]:.1f} ->"
    assert f"file -> refocused -> improved: {spots}" in told.out
    assert any(note in line for line in focus_note(read_lens(source)))
    assert focus_note(lens) == ()


def test_what_varies_may_stand_in_the_file(camkit_command, tmp_path: Path) -> None:
    source, out = tmp_path / "mine.toml", tmp_path / "better.toml"
    text = (PRESCRIPTIONS / "duet.toml").read_text()
    source.write_text(text.replace("conic = -0.9906", 'conic = -0.9906\nvary = ["conic"]'))
    outcome = camkit_command("lens", "optimize", source, "-o", out, *QUICK, "--json")
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out)["variables"] == 2  # and the defocus
    before, after = read_lens(source), read_lens(out)
    assert after.surfaces[4].vary == ("conic",)
    assert after.surfaces[2].curvature_per_mm == before.surfaces[2].curvature_per_mm


def test_a_plane_has_no_conic_and_what_got_worse_is_said(camkit_command, tmp_path: Path) -> None:
    source, out = tmp_path / "mine.toml", tmp_path / "better.toml"
    lens = read_lens(PRESCRIPTIONS / "cooke-triplet.toml")
    first, *others = lens.surfaces
    surfaces = (replace(first, curvature_per_mm=0.0), *others)
    write_lens(replace(lens, surfaces=surfaces, state="near"), source)
    command = ("lens", "optimize", source, "-o", out, "--vary", "conic,thickness", *QUICK)
    outcome = camkit_command(*command, "--json")
    assert outcome.code == 0, outcome.err
    assert "a plane has no conic: that of surface 0 is not free" in outcome.err
    assert "better.toml holds configuration near alone" in outcome.err
    report = json.loads(outcome.out)
    assert report["efl_mm_after"] != report["efl_mm_before"]
    assert report["worse_fields_deg"] == [
        angle
        for angle, before, after in zip(
            *(report[key] for key in ("field_angles_deg", *SPOTS)), strict=True
        )
        if after > before
    ]


def test_focus_positions_are_sought_together(camkit_command, tmp_path: Path) -> None:
    """At 2 m the image of a thin lens lies f^2 / (s - f) = 1.28 mm farther away."""
    source, out = tmp_path / "focusing.toml", tmp_path / "better.toml"
    text = (PRESCRIPTIONS / "cooke-triplet.toml").read_text()
    states = (("far", ""), ("near", "object_distance_mm = 2000.0\n"))
    text += "".join(
        f'[[configuration]]\nname = "{name}"\nfield_angles_deg = [0]\n'
        f"thickness_mm = {{ 5 = 42.5 }}\n{line}"
        for name, line in states
    )
    source.write_text(text)
    command = ("lens", "optimize", source, "-o", out, "--vary", "gaps", "--configurations", "all")
    short = ("--starts", "1", "--steps", "6", "--rays", "6", "--merit", "rms")
    outcome = camkit_command(*command, *short, "--weights", "1,2", "--json")
    assert outcome.code == 0, outcome.err
    report = json.loads(outcome.out)
    assert report["variables"] == 2
    found = report["configurations"]
    assert [found[name]["weight"] for name in ("far", "near")] == pytest.approx([1 / 3, 2 / 3])
    assert found["near"]["spot_rms_mm_after"][0] < 0.3 * found["near"]["spot_rms_mm_before"][0]
    far, near = (read_lens(out, configuration=name) for name in ("far", "near"))
    moved_mm = near.surfaces[5].thickness_mm - far.surfaces[5].thickness_mm
    assert moved_mm == pytest.approx(1.28, abs=0.05)
    again = camkit_command(*command, *short, "--steps", "1", "--overwrite")
    assert "far: EFL 50 mm" in again.out
    for options, message in (
        (("--configuration", "far"), "leave --configuration out"),
        (("--weights", "1"), "one for each of far, near"),
        (("--weights", "1,x"), "takes numbers"),
        (("-o", tmp_path / "x.json"), "hold several configurations"),
    ):
        refused = camkit_command(*command, *options, "--overwrite")
        assert (refused.code, message in refused.err) == (2, True), refused.err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "nothing of the lens is free"),
        (("--vary", "colour"), "--vary names some of"),
        (("--vary", "gaps"), "gaps are those of --configurations"),
        (("--vary", "conic", "--weights", "1"), "belongs to --configurations"),
        (("--vary", "gaps", "--configurations", "all"), "has no configurations"),
        (("--vary", "conic", "--merit", "beauty"), "--merit is one of"),
    ],
)
def test_what_cannot_be_done_is_said(
    options: tuple[str, ...], message: str, camkit_command, tmp_path: Path
) -> None:
    out = tmp_path / "x.toml"
    source = PRESCRIPTIONS / "cooke-triplet.toml"
    outcome = camkit_command("lens", "optimize", source, "-o", out, *options)
    assert outcome.code == 2
    assert message in outcome.err
    assert not out.exists()
