import json
from pathlib import Path

import pytest

from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.paraxial import paraxial_data

PRESCRIPTIONS = Path(__file__).resolve().parents[5] / "models_def" / "prescriptions"
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
    assert all("the beam needs" in note for note in report["notes"])


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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "nothing of the lens is free"),
        (("--vary", "colour"), "--vary names some of"),
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
