"""Images of points by rays, of a lens with one perfect focus."""

import numpy as np
import pytest

from camkit.models_def.optics.thin.peak import LandedLight
from camkit.report.analysis.point_image import NEAR_PX, band_of
from camkit.report.analysis.traced_image import _illumination, image_of, land_band
from tests.bundle_factory import tiny_sensor
from tests.thin_factory import perfect_lens

RAYS = 2000


def test_a_perfect_lens_puts_all_light_into_one_pixel() -> None:
    band = band_of(tiny_sensor(), 0.55)
    light = land_band(perfect_lens(20.0, 2.0), 0.0, band, 6.0, RAYS)
    image = image_of(light, 0.0, 0.0, 6e-3, 1.0)
    assert image.near_share == pytest.approx(1)
    assert image.lost_share == pytest.approx(0, abs=1e-9)
    assert image.patch[64, 64] == pytest.approx(1, abs=1e-6)
    assert image.fwhm_px < 1.3


def test_defocus_spreads_light_over_a_disc() -> None:
    """The cone of F/5 over 1 mm is a disc of 0.2 mm; within 10 px lies its share by area."""
    band = band_of(tiny_sensor(), 0.55)
    light = land_band(perfect_lens(20.0, 2.0, defocus_mm=1.0), 0.0, band, 6.0, 20_000)
    image = image_of(light, 0.0, 0.0, 6e-3, 1.0)
    radius_px = 0.1 / 6e-3
    assert image.near_share == pytest.approx((NEAR_PX / radius_px) ** 2, rel=0.05)
    assert image.fwhm_px == pytest.approx(2 * radius_px, rel=0.1)
    # a disc's line is half an ellipse
    middle = image.lines["tangential"][image.lines["tangential"].size // 2]
    assert middle == pytest.approx(2 / (np.pi * radius_px), rel=0.1)


def test_light_is_known_where_peaks_jump_inward() -> None:
    """Heights that fall stand between those that rise; the first of them is 1."""
    lens = perfect_lens(20.0, 2.0)
    jumped = _illumination(lens, np.array([0.0, 900.0, 300.0, 1500.0]), 6.0)
    rising = _illumination(lens, np.array([0.0, 900.0, 1500.0]), 6.0)
    np.testing.assert_allclose(jumped[[0, 1, 3]], rising)
    assert jumped[2] == pytest.approx(1 + (rising[1] - 1) / 3)


def test_what_is_lost_counts_as_missing_and_the_rest_as_all() -> None:
    light = LandedLight(
        x_px=np.array([0.0, 30.0]),
        y_px=np.array([100.0, 1200.0]),
        share=np.array([0.5, 0.25]),
        losses={"wall": 0.25},
    )
    image = image_of(light, 100.0, 0.3, 6e-3, 0.8)
    assert image.lost_share == pytest.approx(0.25)
    assert image.near_share == pytest.approx(2 / 3)
    assert image.far_share == pytest.approx(2 / 3)
    assert image.height_mm == pytest.approx(0.6)
    # the mirror image of the second ray
    across = image.lines["tangential"]
    assert across[across.size // 2 + 30] == pytest.approx(1 / 6)
    assert across[across.size // 2 - 30] == pytest.approx(1 / 6)
    assert image.lines["radial"].sum() == pytest.approx(1)
