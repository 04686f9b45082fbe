"""The picture of dots against closed forms, and against the orders it knows nothing of."""

import numpy as np
import pytest
from scipy.special import sici

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.wave import PixelGrid
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.pattern import View, dot_picture
from camkit.models_def.optics.dots.unit import DotPlate

CAMERA = DotCamera(cells=24, tiles=4)
FLAT = np.zeros((24, 24))
DOTS = PixelGrid(side_px=11, pitch_um=CAMERA.spacing_um, samples=33)


def _in_slit(widths: float) -> float:
    """Give the light of sinc^2 within so many widths of its middle, to both sides."""
    x = np.pi * widths
    return float(2 * (sici(2 * x)[0] - np.sin(x) ** 2 / x) / np.pi)


@pytest.mark.parametrize("tiles", [1, 2, 4])
def test_a_flat_plate_is_the_square_aperture(tiles: int) -> None:
    light = dot_picture(FLAT, CAMERA, DOTS, View(tiles=tiles))
    # a sub-pixel reaches to half as many widths of the dot as there are units
    assert light[5, 5] == pytest.approx(_in_slit(tiles / 2) ** 2, abs=2e-3)


def test_a_blazed_unit_sends_its_light_one_sub_pixel_down() -> None:
    level = np.broadcast_to(np.arange(24)[:, None] // 3, (24, 24)).copy()
    plate = DotPlate(camera=CAMERA, level=level, levels=8)
    light = dot_picture(plate.height_um, CAMERA, DOTS)
    assert light[6, 5] == pytest.approx(_in_slit(2) ** 2 * np.sinc(1 / 8) ** 2, abs=2e-3)


def test_dots_keep_their_distance_out_of_focus() -> None:
    rng = np.random.default_rng(0)
    plate = DotPlate(camera=CAMERA, level=rng.integers(0, 8, (24, 24)), levels=8)
    sharp, soft = (
        dot_picture(plate.height_um, CAMERA, DOTS, View(defocus_mm=d)) for d in (0.0, 0.1)
    )
    assert np.corrcoef(sharp.ravel(), soft.ravel())[0, 1] > 0.99


def test_a_flat_plate_is_as_soft_before_the_focus_as_behind_it() -> None:
    before, behind = (dot_picture(FLAT, CAMERA, DOTS, View(defocus_mm=d)) for d in (-4.0, 4.0))
    np.testing.assert_allclose(before, behind, atol=1e-12)
    # geometry: 3.493 mm before 50 mm, 4 mm out of focus, is a square of 279 um
    assert before[3:8, 3:8].sum() == pytest.approx((5 * 37.5 / 279.5) ** 2, rel=0.05)


def test_a_shift_by_whole_units_changes_nothing() -> None:
    height = np.random.default_rng(1).random((24, 24))
    there = dot_picture(height, CAMERA, DOTS, View(shift_mm=(CAMERA.unit_mm, -CAMERA.unit_mm)))
    np.testing.assert_allclose(there, dot_picture(height, CAMERA, DOTS), atol=1e-12)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ContractError, match="one unit has 24x24 cells"):
        dot_picture(np.zeros((12, 12)), CAMERA, DOTS)
    with pytest.raises(ContractError, match="too wide for the light at the rim"):
        dot_picture(FLAT, CAMERA, DOTS, View(defocus_mm=30.0))
    with pytest.raises(ContractError, match="must be finite"):
        View(defocus_mm=np.inf)
    with pytest.raises(ContractError, match="tiles must be >= 1"):
        View(tiles=0)
