import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.unit import DotPlate, phase_light

SMALL = DotCamera(cells=24, tiles=1)


def _random_plate(levels: int) -> DotPlate:
    level = np.random.default_rng(1).integers(0, levels, (24, 24))
    return DotPlate(camera=SMALL, level=level, levels=levels)


@pytest.mark.parametrize("levels", [2, 8, 16])
def test_masks_of_one_two_four_steps_make_the_heights(levels: int) -> None:
    plate = _random_plate(levels)
    masks = plate.masks
    assert masks.shape == (levels.bit_length() - 1, 24, 24)
    made = sum(mask * 2**k * plate.etching.step_um for k, mask in enumerate(masks))
    np.testing.assert_allclose(made, plate.height_um, atol=1e-12)


def test_a_mask_that_etches_too_deep_does_so_where_it_stands() -> None:
    plate = _random_plate(8)
    made = plate.etched_um((0.0, 0.0, 0.1))
    deeper = 0.1 * 4 * plate.etching.step_um * plate.masks[2]
    np.testing.assert_allclose(made, plate.height_um + deeper, atol=1e-12)
    np.testing.assert_allclose(plate.etched_um((0.0,) * 3), plate.height_um, atol=1e-12)
    with pytest.raises(ContractError, match="3 masks want 3 errors"):
        plate.etched_um((0.1,))


def test_a_plate_has_the_cells_and_levels_of_its_camera() -> None:
    with pytest.raises(ContractError, match=r"levels must be \(24, 24\) from 0 to 7"):
        DotPlate(camera=SMALL, level=np.zeros((8, 8), np.int64), levels=8)
    with pytest.raises(ContractError, match="from 0 to 8"):
        DotPlate(camera=SMALL, level=np.arange(576).reshape(24, 24) % 9, levels=8)


def test_the_light_is_that_of_the_heights_by_the_index_of_the_glass() -> None:
    plate = _random_plate(8)
    phase = 2 * np.pi / 0.655 * (SMALL.index - 1) * plate.height_um
    np.testing.assert_allclose(plate.light, phase_light(phase), atol=1e-12)
