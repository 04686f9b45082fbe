"""The whole way to a plate: what is asked of it."""

import time
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf
from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.models_def.optics.diffraction.plate import PLATES
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.effective import effective_psf
from camkit.models_def.optics.dots.match import check_levels, match_dots
from camkit.models_def.optics.dots.target import likeness, to_target

SMALL = DotCamera(cells=24, tiles=1)
TARGETS = {
    "learned": lambda: read_plate_psf(Path(PLATES) / "spad-sr.safetensors"),
    "gaussian": lambda: gaussian_psf(1.84),
}


@pytest.mark.parametrize("name", TARGETS)
def test_eight_levels_are_nearer_to_the_psf_than_the_thesis_was(name: str) -> None:
    target = to_target(TARGETS[name]())
    began = time.process_time()
    found = match_dots(target, DotCamera(), 8, np.random.default_rng(0), starts=1)
    assert time.process_time() - began < 60
    assert found.etched.correlation >= 0.9996
    assert found.etched.rmse <= 0.0061
    assert found.etched.efficiency >= 0.85
    # descent wins back what rounding loses
    assert found.rounded.rmse > 3 * found.etched.rmse
    assert found.gerchberg_saxton.rmse > found.refined.rmse
    # and so the array sees it, through 16x16 units and its round areas
    seen = likeness(effective_psf(found.plate.height_um, DotCamera()), target)
    assert seen.correlation >= 0.9996
    assert seen.rmse <= 0.0061
    assert seen.efficiency >= 0.85


def test_one_seed_gives_one_plate() -> None:
    target = to_target(gaussian_psf(1.84))
    one, two = (match_dots(target, SMALL, 4, np.random.default_rng(5), starts=1) for _ in range(2))
    np.testing.assert_array_equal(one.plate.level, two.plate.level)
    assert one.etched == two.etched


@pytest.mark.parametrize("levels", [-2, 0, 1, 6, 128])
def test_levels_that_masks_cannot_make_are_refused(levels: int) -> None:
    with pytest.raises(ContractError, match=f"levels are 2, 4, 8, ... 64; got {levels}"):
        check_levels(levels)
