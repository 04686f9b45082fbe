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
from camkit.report.pages.lens.lens_facts import analyse, to_json
from camkit.report.pages.lens.lens_page import write_lens_page
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


def test_field_that_loses_all_rays_is_null_in_valid_json_and_the_page_is_made(
    tmp_path: Path,
) -> None:
    facts = analyse(_blocked(), Pupil())
    found = json.loads(json.dumps(to_json(facts), allow_nan=False))
    assert found["fields"][0]["spot_rms_mm"] > 0
    assert found["fields"][1]["spot_rms_mm"] is None
    assert found["fields"][1]["rays"]["valid"] == 0
    assert any("no ray reaches the sensor" in note for note in found["notes"])
    page = write_lens_page(facts, tmp_path, "blocked")[0]
    assert "no ray reaches the sensor" in page.read_text(encoding="utf-8")


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
    assert text.count("data:image/svg") == 6
    json.dumps(to_json(facts), allow_nan=False)
