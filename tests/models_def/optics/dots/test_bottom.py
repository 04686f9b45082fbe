import numpy as np
import pytest

from camkit.models_def.optics.dots.bottom import DEPTH_ERROR, best_bottom
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.effective import effective_psf
from camkit.models_def.optics.dots.target import likeness
from camkit.models_def.optics.dots.unit import DotPlate

CAMERA = DotCamera(cells=24, tiles=4)


@pytest.fixture(name="plate")
def mostly_deep_plate() -> DotPlate:
    level = np.random.default_rng(0).choice(8, (24, 24), p=[0.05] * 6 + [0.35] * 2)
    return DotPlate(camera=CAMERA, level=level, levels=8)


def _error(plate: DotPlate, depth_error: float) -> float:
    made = effective_psf(plate.etched_um((depth_error,) * 3), CAMERA)
    return likeness(made, effective_psf(plate.height_um, CAMERA)).rmse


def test_another_bottom_leaves_the_dots_as_they_are(plate: DotPlate) -> None:
    found = best_bottom(plate, plate.light)
    np.testing.assert_allclose(found.light, plate.light, atol=1e-15)
    up = (found.level - plate.level) % 8
    assert (up == up[0, 0]).all()


def test_wrong_depths_spoil_it_less_than_the_average_one_as_the_array_sees_it(
    plate: DotPlate,
) -> None:
    found = best_bottom(plate, plate.light)
    others = [DotPlate(camera=CAMERA, level=(plate.level + up) % 8, levels=8) for up in range(8)]

    def worst(one: DotPlate) -> float:
        return max(_error(one, error) for error in (-DEPTH_ERROR, DEPTH_ERROR))

    assert worst(found) < 0.6 * float(np.mean([worst(one) for one in others]))
