import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.dots.beginning import best_beginning
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.effective import effective_psf, seen_by_circles
from camkit.models_def.optics.dots.pattern import View
from camkit.models_def.optics.dots.target import likeness, to_target
from camkit.models_def.optics.dots.unit import DotPlate

CAMERA = DotCamera(cells=24, tiles=8)


@pytest.fixture(name="plate", scope="module")
def lopsided_plate() -> DotPlate:
    """Levels that send most light down and to the right."""
    rows, columns = np.indices((24, 24))
    level = (rows // 3 + 2 * (columns // 3) + np.random.default_rng(0).integers(0, 3, (24, 24))) % 8
    return DotPlate(camera=CAMERA, level=level, levels=8)


def test_even_light_fills_circles_by_their_area() -> None:
    light = np.full((165, 165), 1.0)
    seen = seen_by_circles(light, 37.5 / 33, CAMERA, 3)
    np.testing.assert_allclose(seen, np.pi * 15**2 / (37.5 / 33) ** 2, rtol=2e-3)


def test_the_array_sees_the_dots_that_the_orders_promise(plate: DotPlate) -> None:
    seen, promised = effective_psf(plate.height_um, CAMERA), plate.light
    assert np.unravel_index(seen.argmax(), seen.shape) == np.unravel_index(
        promised.argmax(), promised.shape
    )
    found = likeness(seen, promised)
    assert found.correlation > 0.9995
    # the feet of dots fall between the areas
    assert 0.9 < seen.sum() / promised.sum() < 1


def test_one_unit_alone_is_less_like_them_than_many(plate: DotPlate) -> None:
    target = to_target(plate.light)
    rmse = [
        likeness(effective_psf(plate.height_um, CAMERA, View(tiles=tiles)), target).rmse
        for tiles in (1, 3, 8)
    ]
    assert rmse[0] > 2 * rmse[1] > 4 * rmse[2]


def test_a_quarter_turn_of_the_plate_turns_the_psf(plate: DotPlate) -> None:
    straight = effective_psf(plate.height_um, CAMERA)
    turned = effective_psf(plate.height_um, CAMERA, View(turn_rad=np.pi / 2))
    # from +x to +y, rows downwards, is clockwise
    np.testing.assert_allclose(turned, np.rot90(straight, -1), atol=1e-9)


def test_a_wider_window_has_the_narrower_one_in_its_middle(plate: DotPlate) -> None:
    wide = effective_psf(plate.height_um, CAMERA, side=15)
    np.testing.assert_allclose(wide[2:-2, 2:-2], effective_psf(plate.height_um, CAMERA), rtol=1e-9)
    assert wide.sum() < 1


def test_a_little_defocus_costs_light_and_not_likeness(plate: DotPlate) -> None:
    sharp = effective_psf(plate.height_um, CAMERA)
    soft = effective_psf(plate.height_um, CAMERA, View(defocus_mm=0.15))
    assert soft.sum() < 0.99 * sharp.sum()
    assert likeness(soft, sharp).correlation > 0.999


def test_a_beginning_moves_no_dot_and_betters_what_is_seen(plate: DotPlate) -> None:
    target = to_target(plate.light)
    begin = best_beginning(plate.height_um, CAMERA, target)
    rolled = np.roll(plate.height_um, begin, (0, 1))
    before, after = (
        likeness(effective_psf(h, CAMERA), target).rmse for h in (plate.height_um, rolled)
    )
    assert after <= before


def test_an_even_side_is_refused(plate: DotPlate) -> None:
    with pytest.raises(ContractError, match="side must be odd"):
        effective_psf(plate.height_um, CAMERA, side=10)
