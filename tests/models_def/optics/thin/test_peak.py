"""Peaks against blurs whose shares are known."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.thin.peak import (
    LandedLight,
    land_light,
    measure_peak,
    peak_height_px,
    share_within,
)
from tests.thin_factory import perfect_lens

PITCH_UM = 5.0


def test_a_point_has_all_its_light_in_the_peak() -> None:
    peak = measure_peak(perfect_lens(50.0, 5.0), 0.0, 0.55, PITCH_UM, rays=2000)
    assert peak.shares == pytest.approx((1.0,) * 5)
    assert abs(peak.height_px) < 5
    assert peak.losses == {}


def test_a_defocused_disc_has_the_share_of_its_area() -> None:
    """A beam of F/5 (edge slope 0.1) 1 mm behind focus: a disc of 20 px, evenly lit enough."""
    lens = perfect_lens(500.0, 5.0, defocus_mm=10.0)
    light = land_light(lens, 0.0, 0.55, PITCH_UM, rays=100_000)
    assert share_within(light, 0.0, 10.0) == pytest.approx((10 / 20) ** 2, rel=0.01)
    assert share_within(light, 0.0, 5.0) == pytest.approx((5 / 20) ** 2, rel=0.03)


def test_the_peak_is_found_in_haze() -> None:
    rng = np.random.default_rng(0)
    haze = rng.uniform(-800, 800, (2, 30_000))
    core = rng.normal(0, 2, (2, 3_000)) + np.array([[0.0], [317.3]])
    x, y = np.concatenate([haze, core], axis=1)
    light = LandedLight(x_px=np.abs(x), y_px=y, share=np.full(x.size, 1 / x.size), losses={})
    assert peak_height_px(light) == pytest.approx(317.3, abs=1.0)
    assert share_within(light, peak_height_px(light), 10.0) == pytest.approx(3 / 33, rel=0.02)


@pytest.mark.parametrize("wide_px", [0.0, 0.3, 3.0])
def test_a_point_smaller_than_the_disc_lies_in_its_middle(wide_px: float) -> None:
    angle = np.linspace(0, 2 * np.pi, 1001)
    radius = wide_px * np.sqrt(np.linspace(0, 1, 1001))
    x, y = np.abs(radius * np.cos(7 * angle)), -42.4 + radius * np.sin(7 * angle)
    light = LandedLight(x_px=x, y_px=y, share=np.full(x.size, 1 / x.size), losses={})
    assert peak_height_px(light) == pytest.approx(-42.4, abs=0.1)


@pytest.mark.parametrize("in_core", [0.9, 0.5, 0.1])
def test_so_it_does_amid_haze(in_core: float) -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        sharp = rng.uniform(size=20_000) < in_core
        x, y = np.where(sharp, rng.normal(0, 0.3, (2, 20_000)), rng.normal(0, 200, (2, 20_000)))
        light = LandedLight(x_px=np.abs(x), y_px=y + 317.3, share=np.full(x.size, 5e-5), losses={})
        assert peak_height_px(light) == pytest.approx(317.3, abs=0.2)


def test_rays_beside_every_disc_make_no_peak_of_nothing() -> None:
    light = LandedLight(
        x_px=np.full(3, 4.99), y_px=np.zeros(3), share=np.array([0.0, 0.0, 0.0]), losses={}
    )
    assert np.isfinite(peak_height_px(light))


def test_rays_that_rims_take_count_as_missing() -> None:
    lens = perfect_lens(50.0, 5.0)
    narrow = replace(lens.surfaces[2], semi_diameter_mm=2.5)
    lens = replace(lens, surfaces=(*lens.surfaces[:2], narrow))
    peak = measure_peak(lens, 0.0, 0.55, PITCH_UM, rays=40_000)
    assert peak.within_px(10.0) == pytest.approx(0.25, rel=0.01)
    assert peak.losses == {"vignetted": pytest.approx(0.75, rel=0.01)}


def test_a_field_without_light_on_the_meridian_is_an_error() -> None:
    none = LandedLight(x_px=np.full(3, 50.0), y_px=np.zeros(3), share=np.ones(3) / 3, losses={})
    with pytest.raises(ContractError, match="no light reaches the meridian"):
        peak_height_px(none)
