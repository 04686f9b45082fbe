"""Squares: half as bright on average where they cover a quarter, the same from the same seed."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.scenes import named_scene
from camkit.scenes.squares import LEVELS, squares_scene


def test_a_quarter_of_the_picture_is_dark() -> None:
    scene = named_scene("squares:4", 1500, 1400)
    dark, bright = LEVELS
    assert (scene.min(), scene.max()) == pytest.approx(LEVELS)
    assert scene.mean() == pytest.approx(bright - (bright - dark) / 4, rel=0.02)
    np.testing.assert_array_equal(scene[0], scene[2])


def test_a_seed_turns_and_moves_them() -> None:
    one, again, other = (squares_scene(seed, 400, 420) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert (one != other).any()


def test_no_size_is_refused() -> None:
    with pytest.raises(ContractError, match="squares need a size"):
        squares_scene(1, 0, 5)
