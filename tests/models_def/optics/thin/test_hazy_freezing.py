"""A lens with a haze is frozen by its peaks: light is where rays say, and is counted once."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from camkit.bundle.sensor import BayerSensor, Extent
from camkit.errors import ContractError
from camkit.haze import Haze
from camkit.models_def.optics.thin.hazy_freezing import (
    HazyGrid,
    _distortion,
    arriving,
    flat_light,
    freeze_hazy,
    peaks_off_px,
)
from camkit.models_def.optics.thin.middle import corner_angle_rad
from camkit.models_def.optics.thin.peak import land_light, peak_height_px
from tests.bundle_factory import tiny_sensor
from tests.thin_factory import perfect_lens

PITCH_UM = 60.0
RAYS = 2000
LENS = perfect_lens(40.0, 3.0, defocus_mm=6.4)


def _sensor(width_px: int = 96, height_px: int = 64) -> BayerSensor:
    return tiny_sensor().model_copy(
        update={"extent": Extent(width_px=width_px, height_px=height_px, pixel_pitch_um=PITCH_UM)}
    )


@pytest.fixture(scope="module")
def frozen() -> tuple:  # type: ignore[type-arg]
    return freeze_hazy(
        LENS, _sensor(), HazyGrid(fields=3, wavelengths=2, core_px=6, cell_px=4, rays=RAYS)
    )


def test_all_light_is_in_core_and_haze(frozen: tuple) -> None:  # type: ignore[type-arg]
    optics, report = frozen
    haze = optics.haze
    assert isinstance(haze, Haze)
    total = haze.core_share + haze.kernels.sum(axis=(-2, -1), dtype=np.float64)
    assert total.max() == pytest.approx(1.0, abs=1e-4)
    assert report["haze_kept"] >= 0.995
    assert 0 < report["core_share"] < 0.9
    np.testing.assert_allclose(optics.psf.kernels.sum(axis=(-2, -1)), 1, atol=1e-4)
    assert report["cells"] == haze.kernels.shape[-1]


def test_core_and_haze_are_the_spot_of_rays(frozen: tuple) -> None:  # type: ignore[type-arg]
    optics, _ = frozen
    haze = optics.haze
    light = land_light(LENS, 0.0, 0.535, PITCH_UM, 40_000)
    distance = np.hypot(light.x_px, light.y_px)
    share = light.share / light.share.sum()
    kernel = haze.kernels[0, 0].mean(axis=0)
    total = haze.core_share[0, 0].mean() + kernel.sum()
    faded = np.clip((distance / 6 - 0.625) / 0.375, 0, 1)
    core = (share * (0.5 + 0.5 * np.cos(np.pi * faded))).sum()
    assert haze.core_share[0, 0].mean() / total == pytest.approx(core, abs=0.05)
    # a cell spreads its light by a third of its side squared
    y, x = (np.indices(kernel.shape) - kernel.shape[0] // 2) * haze.cell_px
    wide = (kernel * (x**2 + y**2)).sum() / kernel.sum()
    far = share * (0.5 - 0.5 * np.cos(np.pi * faded))
    assert wide == pytest.approx((far * distance**2).sum() / far.sum() + 16 / 3, rel=0.15)


def test_the_corner_is_where_its_peak_lies() -> None:
    angle = corner_angle_rad(LENS, 50.0, PITCH_UM, RAYS)
    at = peak_height_px(land_light(LENS, angle, 0.55, PITCH_UM, RAYS))
    assert at == pytest.approx(50.0, rel=0.01)


def test_no_peak_so_far_out_is_said() -> None:
    with pytest.raises(ContractError, match="no peak of perfect reaches the corner"):
        corner_angle_rad(LENS, 1e5, PITCH_UM, RAYS)


def test_a_lens_of_tangents_falls_as_the_fourth_power_of_the_cosine() -> None:
    angles = np.linspace(0, math.radians(30), 31)
    np.testing.assert_allclose(
        arriving(angles, 1000 * np.tan(angles)), np.cos(angles) ** 4, rtol=5e-3
    )


def test_an_even_scene_is_brightest_on_the_axis() -> None:
    light = flat_light(LENS, np.array([0.0, 25.0, 50.0]), PITCH_UM, rays=20_000)
    assert light[0] == 1
    angle = math.atan(50 * PITCH_UM * 1e-3 / 40)
    assert light[2] == pytest.approx(math.cos(angle) ** 4, abs=0.1)


def test_peaks_are_where_the_field_heights_say(frozen: tuple) -> None:  # type: ignore[type-arg]
    psf = frozen[0].psf
    half = math.hypot(96, 64) / 2 * PITCH_UM * 1e-3
    assert psf.field_heights_mm[0] == 0
    assert psf.field_heights_mm[-1] == pytest.approx(half, rel=0.02)
    assert abs(psf.distortion.coefficients[0, 0] - 1) < 0.5


@pytest.mark.parametrize("fields", [3, 4, 5, 9])
def test_between_the_fields_the_distortion_is_that_of_the_lens(fields: int) -> None:
    """r (1 - 0.06 r^2) is two powers, and two heights off the axis tell them."""
    angles = np.linspace(0, math.radians(25), fields)

    def bent(angle: Any) -> Any:
        ideal = np.tan(angle) / np.tan(angles[-1])
        return 18.0 * ideal * (1 - 0.06 * ideal**2) / 0.94

    found = _distortion(LENS, angles, bent(angles), 3)
    unit = 40.0 * np.tan(angles[1:] - angles[1] / 2) / found.radius_mm
    placed = sum(c * unit ** (2 * k + 1) for k, c in enumerate(found.coefficients[0]))
    wanted = bent(angles[1:] - angles[1] / 2)
    np.testing.assert_allclose(placed * found.radius_mm, wanted, atol=1e-6)


def test_peaks_tell_a_lens_from_another(frozen: tuple) -> None:  # type: ignore[type-arg]
    psf = frozen[0].psf
    assert peaks_off_px(LENS, psf, rays=RAYS) < 1
    known = psf.distortion
    stretched = replace(known, coefficients=1.1 * known.coefficients)
    assert peaks_off_px(LENS, replace(psf, distortion=stretched), rays=RAYS) > 3


def test_a_blur_without_a_peak_is_frozen_about_its_chief_rays() -> None:
    extent = Extent(width_px=96, height_px=64, pixel_pitch_um=5.0)
    sensor = tiny_sensor().model_copy(update={"extent": extent})
    blurred = perfect_lens(40.0, 4.0, defocus_mm=6.4)  # a disc of 128 px
    few = HazyGrid(fields=3, wavelengths=1, core_px=40, cell_px=8, rays=RAYS)
    optics, report = freeze_hazy(blurred, sensor, few)
    assert report["about"] == "chief ray"
    half_mm = math.hypot(96, 64) / 2 * 5e-3
    assert optics.psf.field_heights_mm[-1] == pytest.approx(half_mm, rel=1e-3)
    assert peaks_off_px(blurred, optics.psf, rays=RAYS) < 1


def test_a_sharp_lens_has_a_haze_of_nothing() -> None:
    optics, report = freeze_hazy(
        perfect_lens(40.0, 3.0),
        _sensor(),
        HazyGrid(fields=3, wavelengths=1, core_px=40, rays=RAYS),
    )
    assert optics.haze is not None
    assert not optics.haze.kernels.any()
    assert (report["cells"], report["haze_kept"]) == (1, 1.0)


def test_two_fields_are_too_few() -> None:
    with pytest.raises(ContractError, match="3 fields at least; got 2"):
        HazyGrid(fields=2)
