"""Profiles are lensfun's formulas in the millimetres of the sensor."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.calibration.lensfun.database import Database, Lens
from camkit.calibration.lensfun.models import Distortion
from camkit.calibration.lensfun.profile import Frame, filling_scale, profile_of
from camkit.errors import DecodeError
from camkit.runtime.geometry.distortion import distort_points
from tests.lensfun_factory import ZOOM, write_database

FULL = Frame(
    size_px=(6000, 4000),
    pitch_um=1000 * math.hypot(36, 24) / math.hypot(6000, 4000),
    crop_factor=1.0,
    channels=3,
)


@pytest.fixture
def lens(tmp_path: Path) -> Lens:
    return Database(write_database(tmp_path)).find(ZOOM)[0]


@pytest.mark.parametrize(
    ("model", "terms"),
    [("ptlens", (0.02, -0.06, 0.03)), ("poly3", (-0.05,)), ("poly5", (-0.03, 0.004))],
)
def test_each_model_becomes_the_same_polynomial(model: str, terms: tuple[float, ...]) -> None:
    entry = Distortion(model=model, focal_mm=24.0, terms=terms)
    radial = entry.to_radial(12.0, 3).to_distortion()
    r = np.linspace(0, 1.8, 50)
    d = {
        "ptlens": lambda a, b, c: a * r**4 + b * r**3 + c * r**2 + (1 - a - b - c) * r,
        "poly3": lambda k1: k1 * r**3 + (1 - k1) * r,
        "poly5": lambda k1, k2: r * (1 + k1 * r**2 + k2 * r**4),
    }[model](*terms)
    points = np.stack([r * 12.0, np.zeros(50)], axis=-1)
    np.testing.assert_allclose(distort_points(points, radial)[:, 0] / 12.0, d, atol=1e-12)
    np.testing.assert_allclose(entry.captured_radius(r), d, atol=1e-12)


def test_the_unit_is_half_the_shorter_side_of_the_measured_picture(lens: Lens) -> None:
    found = profile_of([lens], 24.0, FULL)
    assert found.profile.distortion is not None
    half_px = found.profile.distortion.radius_mm / FULL.pitch_um * 1000
    assert half_px == pytest.approx(2000)
    assert found.residual_px < 1e-9


def test_a_crop_sees_the_middle_of_what_was_measured(lens: Lens) -> None:
    crop = replace(FULL, crop_factor=1.5, pitch_um=FULL.pitch_um / 1.5)
    found = profile_of([lens], 24.0, crop)
    assert found.profile.distortion is not None
    half_px = found.profile.distortion.radius_mm / crop.pitch_um * 1000
    assert half_px == pytest.approx(3000)


def test_a_picture_of_another_aspect_keeps_the_scale_of_the_diagonal(lens: Lens) -> None:
    """A 4:3 lens measured at crop 2 on a 3:2 sensor of crop 2: unit = diagonal / 2 / hypot(4/3, 1)."""  # noqa: E501 # fmt: skip
    small = replace(lens, crop_factor=2.0, aspect=4 / 3)
    frame = replace(FULL, crop_factor=2.0, pitch_um=FULL.pitch_um / 2)
    found = profile_of([small], 24.0, frame)
    assert found.profile.distortion is not None
    half_px = found.profile.distortion.radius_mm / frame.pitch_um * 1000
    assert half_px == pytest.approx(math.hypot(6000, 4000) / 2 * 3 / 5)


@pytest.mark.parametrize("terms", [(0.0, 0.03, 0.0), (0.01, 0.01, -0.01), (0.0, -0.02, 0.0)])
def test_the_picture_grows_until_no_border_is_repeated_and_no_more(
    lens: Lens, terms: tuple[float, float, float]
) -> None:
    entry = Distortion(model="ptlens", focal_mm=24.0, terms=terms)
    found = profile_of([replace(lens, distortion=(entry,))], 24.0, FULL)
    assert found.profile.distortion is not None
    pitch_mm = FULL.pitch_um / 1000
    x, y = np.meshgrid(np.arange(6000) - 2999.5, np.arange(4000) - 1999.5, sparse=True)
    edges = [(x[0], np.full(6000, -1999.5)), (np.full(4000, 2999.5), y[:, 0])]
    border = np.concatenate([np.stack(one, axis=-1) for one in edges])
    seen = distort_points(border * pitch_mm, found.profile.distortion.to_distortion()) / pitch_mm
    beyond = np.maximum(np.abs(seen[:, 0]) - 2999.5, np.abs(seen[:, 1]) - 1999.5).max()
    assert beyond < 0.5
    if found.scale < 1:
        assert abs(beyond) < 0.01
        assert any("enlarged by" in note for note in found.notes)
    assert (found.scale < 1) == (terms[1] > 0)
    assert found.residual_px < 1e-9
    as_lensfun = profile_of([replace(lens, distortion=(entry,))], 24.0, FULL, scale=1.0)
    assert as_lensfun.profile.distortion == entry.to_radial(12.0, 3).model_copy(
        update={"radius_mm": as_lensfun.profile.distortion.radius_mm}
    )
    assert filling_scale(found.profile.distortion, FULL) == 1


def test_illumination_is_the_formula_of_pa_with_the_corner_as_unit(lens: Lens) -> None:
    found = profile_of([lens], 24.0, FULL, aperture=2.8)
    assert found.profile.illumination is not None
    light = found.profile.illumination.to_illumination()
    r = np.linspace(0, 1, 300)
    heights_mm = r * math.hypot(36, 24) / 2
    known = np.interp(heights_mm**2, light.heights_mm**2, light.light)
    wanted = 1 - 0.9 * r**2 + 0.3 * r**4 - 0.1 * r**6
    np.testing.assert_allclose(known, wanted, atol=1e-4)
    assert any("24 mm, f/2.8, 10 m" in note for note in found.notes)


def test_the_smallest_sensor_that_holds_the_captures_counts(lens: Lens) -> None:
    measured = [replace(lens, crop_factor=crop) for crop in (1.0, 1.5, 2.0)]
    frame = replace(FULL, crop_factor=1.6, pitch_um=FULL.pitch_um / 1.6)
    assert profile_of(measured, 24.0, frame).lens.crop_factor == 1.5
    with pytest.raises(DecodeError, match=r"measured with crop factor 2; the captures have 1.6"):
        profile_of(measured[2:], 24.0, frame)


def test_a_profile_that_folds_is_refused_by_name(tmp_path: Path) -> None:
    lenses = Database(write_database(tmp_path)).find("Folding 8mm")
    with pytest.raises(DecodeError, match=r"Folding 8mm at 8 mm \(poly3\) folds back inside"):
        profile_of(lenses, 8.0, FULL)


def test_a_lens_without_distortion_is_refused(tmp_path: Path) -> None:
    lenses = Database(write_database(tmp_path)).find("Unmeasured 50mm")
    with pytest.raises(DecodeError, match="has no distortion of Unmeasured 50mm"):
        profile_of(lenses, 50.0, FULL)


def test_vignetting_that_leaves_no_light_is_left_out(lens: Lens) -> None:
    dark = replace(lens.vignetting[0], terms=(-1.5, 0.0, 0.0))
    found = profile_of([replace(lens, vignetting=(dark,), kind="fisheye")], 24.0, FULL)
    assert found.profile.illumination is None
    assert any("leaves no light" in note for note in found.notes)
    assert any("its projection stays" in note for note in found.notes)
