"""What is said of a lens, also where it passes no light."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.shape.phase import parse_phase
from camkit.report.pages.lens.lens_facts import analyse
from camkit.report.pages.lens.lens_json import WHY, to_json
from camkit.report.pages.lens.lens_page import lens_page, write_lens_page
from camkit.report.pages.lens.lens_pupil import CONVERGED, choose_pupil
from tests.physics.reference_lenses import cooke_triplet

KEYS = {
    *("efl_mm", "bfl_mm", "f_number", "total_track_mm", "entrance_pupil_mm", "exit_pupil_mm"),
    *("seidel_mm", "pupil", "pupil_sampling", "fields"),
}
FIELD_KEYS = {
    *("field_angle_deg", "wavelength_um", "spot_rms_mm", "spot_max_mm", "distortion_percent"),
    "relative_illumination",
}


def _cooke(*angles_deg: float) -> Lens:
    return replace(cooke_triplet(), field_angles_rad=tuple(map(math.radians, angles_deg)))


def test_object_has_every_key_and_the_published_numbers() -> None:
    found = to_json(analyse(_cooke(0, 14, 20), Pupil(definition="stop")))
    assert set(found) >= KEYS
    assert len(found["fields"]) == 3
    assert all(set(field) >= FIELD_KEYS for field in found["fields"])
    assert found["pupil"] == "stop"
    assert found["pupil_sampling"] == "hexapolar:6"
    assert found["efl_mm"] == pytest.approx(49.9997830714319, abs=1e-11)
    assert found["seidel_mm"][0] == pytest.approx(-0.006960263349, abs=1e-12)
    assert found["fields"][2]["field_angle_deg"] == 20
    assert found["fields"][2]["spot_rms_mm"] == pytest.approx(0.01632124, abs=6e-9)
    assert found["total_track_mm"] == pytest.approx(60.17675, abs=1e-9)


def test_note_says_that_few_rings_overstate_the_spot() -> None:
    facts = analyse(_cooke(0, 14), Pupil())
    assert any("hexapolar:6" in note and "+15%" in note for note in facts.notes)


def test_all_wavelengths_together_stand_in_page_and_json() -> None:
    lens = replace(_cooke(0, 20), wavelengths_um=(0.48, 0.55, 0.65))
    facts = analyse(lens, Pupil(sampling="gauss:8x16"), image=False)
    rows = to_json(facts)["all_wavelengths"]
    assert [row["field_angle_deg"] for row in rows] == [0, 20]
    axis_mm, edge_mm = (row["spot_rms_mm"] for row in rows)
    # the mean square of the wavelengths, and beside the axis the distances of their centroids
    each_mm = facts.rms_mm.square().mean(1).sqrt().tolist()
    assert axis_mm == pytest.approx(each_mm[0], rel=1e-9)
    assert edge_mm > 1.0001 * each_mm[1]
    page = str(lens_page(facts, {}))
    assert f"'20°', 'all', '', '{1000 * edge_mm:.5g}'" in page


def _blocked() -> Lens:
    lens = _cooke(0, 35)
    rims = (5.2, math.inf, math.inf, 3.9, math.inf, 5.2)
    surfaces = zip(lens.surfaces, rims, strict=True)
    return replace(lens, surfaces=tuple(replace(s, semi_diameter_mm=rim) for s, rim in surfaces))


def test_glass_of_no_thickness_is_noted() -> None:
    lens = find_lens("duet")
    i = next(i for i, s in enumerate(lens.surfaces) if s.glass != "air")
    surfaces = list(lens.surfaces)
    surfaces[i] = replace(surfaces[i], thickness_mm=-1.0)
    notes = analyse(replace(lens, surfaces=tuple(surfaces)), Pupil()).notes
    assert any("-1 mm thick, which cannot be made" in note for note in notes)


def test_the_page_names_terms_of_a_phase_and_has_chief_heights() -> None:
    lens = _cooke(14)
    phase = parse_phase((5.0,), {"x3": 40.0, "x2y": -2.0}, radius_mm=9.0, order=None)
    surfaces = (replace(lens.surfaces[0], phase=phase), *lens.surfaces[1:])
    facts = analyse(replace(lens, surfaces=surfaces), Pupil(), image=False)
    page = str(lens_page(facts, {}))
    assert "of lengths / 9 mm), rad: r2 5, x3 40, x2y -2" in page
    assert "'chief height, mm'" in page
    assert f"{float(facts.chief_mm[0, 0]):.5g}" in page


def test_field_that_loses_all_rays_is_null_in_valid_json_and_the_page_is_made(
    tmp_path: Path,
) -> None:
    facts = analyse(_blocked(), Pupil())
    found = json.loads(json.dumps(to_json(facts), allow_nan=False))
    assert found["fields"][0]["spot_rms_mm"] > 0
    assert found["fields"][1]["spot_rms_mm"] is None
    assert found["fields"][1]["rays"]["valid"] == 0
    assert any("no ray reaches the sensor" in note for note in found["notes"])
    assert "chief ray does not reach the sensor" in found["fields"][1][WHY]["spot_rms_mm"]
    files = write_lens_page(facts, tmp_path, "blocked")
    assert "no ray reaches the sensor" in files[0].read_text(encoding="utf-8")
    charts = {
        path.stem: path.read_text(encoding="utf-8") for path in files if path.suffix == ".svg"
    }
    for name in ("spots", "psf", "encircled", "mtf", "rayfans", "opdfans"):
        assert "left out: 35° (the chief ray does not reach" in charts[f"blocked-{name}"]


def _nulls(value: object, place: str = "") -> list[str]:
    """Return the places of nulls that have no reason beside them."""
    if isinstance(value, list):
        return [hit for inner in value for hit in _nulls(inner, f"{place}[]")]
    if not isinstance(value, dict):
        return []
    found = []
    for name, inner in value.items():
        none = inner is None or (isinstance(inner, list) and None in inner)
        if none and not value.get(WHY, {}).get(name):
            found.append(f"{place}.{name}")
        found += _nulls(inner, f"{place}.{name}")
    return found


def test_every_null_has_a_reason_beside_it() -> None:
    afocal = replace(_window(), object_distance_mm=math.inf)
    for lens in (_blocked(), _window(), afocal):
        found = to_json(analyse(lens, Pupil(definition="stop")))
        assert "null" in json.dumps(found, allow_nan=False)
        assert _nulls(found) == []


@pytest.mark.parametrize("lens", [_cooke(0, 14, 20), find_lens("duet"), find_lens("double-gauss")])
def test_usual_sampling_earns_no_note(lens: Lens) -> None:
    chosen = choose_pupil(lens)
    convergence = chosen.convergence
    mine = convergence.rms_mm[convergence.samplings.index(chosen.pupil.sampling)]
    assert float((mine / convergence.rms_mm[-1] - 1).abs().max()) <= CONVERGED
    assert not any(chosen.pupil.sampling in note for note in analyse(lens, chosen).notes)


def test_vignetted_fields_take_more_rays() -> None:
    lens = replace(_blocked(), field_angles_rad=(0.0, math.radians(20)))
    assert choose_pupil(_cooke(0, 20)).pupil.sampling == "gauss:8x16"
    assert len(choose_pupil(lens).pupil.samples.x) > 128


def test_pupil_that_was_taken_is_named_with_the_reason(tmp_path: Path) -> None:
    found = to_json(analyse(_cooke(0), choose_pupil(_cooke(0))))
    assert found["pupil"] == "paraxial"
    assert "the usual one" in found["pupil_reason"]
    asked = to_json(analyse(_cooke(0), choose_pupil(_cooke(0), "chief", "grid:20")))
    assert (asked["pupil"], asked["pupil_sampling"]) == ("chief", "grid:20")
    assert asked["pupil_reason"] == asked["pupil_sampling_reason"] == "it was asked for"


def test_strehl_and_encircled_energy_stand_in_the_json() -> None:
    found = to_json(analyse(_cooke(0, 20), Pupil(sampling="gauss:8x16")))
    assert all(0 < field["strehl"] < 1 for field in found["fields"])
    for row in found["encircled_energy"]:
        assert row["by"] == "waves"
        assert 0 < row["radius_50_mm"] < row["radius_80_mm"] < row["radius_90_mm"]


def _window() -> Lens:
    flat = Surface(curvature_per_mm=0.0, thickness_mm=3.0, glass="N-BK7-Schott")
    return Lens(
        name="window <b>",
        surfaces=(flat, Surface(curvature_per_mm=0.0, thickness_mm=20.0)),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=2.0,
        field_angles_rad=(0.0, 0.1),
        object_distance_mm=300.0,
    )


def test_planes_with_a_near_object_get_a_page_without_foreign_files(
    tmp_path: Path,
) -> None:
    facts = analyse(_window(), Pupil(definition="stop"))
    files = write_lens_page(facts, tmp_path, "window")
    text = files[0].read_text(encoding="utf-8")
    assert "window &lt;b&gt;" in text
    assert text.count("<script") == 1
    assert all(source.startswith("data:") for source in re.findall('src="([^"]*)', text))
    assert {path.suffix for path in files} == {".html", ".svg", ".png"}
    assert all(path.stat().st_size > 0 for path in files)
    assert text.count("data:image/svg") == 10
    json.dumps(to_json(facts), allow_nan=False)
