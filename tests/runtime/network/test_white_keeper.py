"""Lamps stay white behind the colour matrix, whatever a network makes of their colours."""

import warnings
from collections.abc import Sequence

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.colorimetry import Matrix
from camkit.noise import NoiseModel
from camkit.runtime.network.white_keeper import white_keeper
from camkit.runtime.signal.stabilise import stabilise, unstabilise

NOISE = NoiseModel(shot=(2e-4, 1e-4, 3e-4), read_variance=(1e-6, 1e-6, 1e-6))
SCALE = 64.0
TURN: Matrix = np.array([[1.8, -0.6, -0.2], [-0.3, 1.6, -0.3], [0.1, -0.7, 1.6]])
ROUNDING = 1e-3
"""Of light that was stabilised and taken back."""


def _stable(light: Sequence[Sequence[float]]) -> FloatArray:
    """Return pixels of three colours as a stabilised row (3, 1, n)."""
    return stabilise(np.array(light, np.float32).T[:, None], NOISE, scale=SCALE)


def _kept(output: FloatArray, front: FloatArray, turn: Matrix = TURN) -> FloatArray:
    got = output.copy()
    white_keeper(NOISE, SCALE, turn).keep(got, front)
    return got


def _shown(stable: FloatArray) -> FloatArray:
    """Return (3, n) in the colours of the output."""
    return np.asarray(TURN @ unstabilise(stable, NOISE, scale=SCALE)[:, 0], np.float32)


def test_a_lamp_whose_colours_are_raised_apart_stays_white_in_the_output() -> None:
    """Each of its colours is above white, and the matrix takes green away altogether."""
    front, output = _stable([[2, 2, 2]]), _stable([[40, 5, 40]])
    assert _shown(output)[1] < 0
    got = _shown(_kept(output, front))
    assert got.min() > 1 - ROUNDING
    np.testing.assert_allclose(got[[0, 2]], _shown(output)[[0, 2]], rtol=ROUNDING)


def test_what_the_front_end_has_below_white_is_admitted() -> None:
    """A red lamp is dark in green, and black behind the matrix."""
    front, output = _stable([[30, 1.2, 1.0]]), _stable([[60, 1.2, 1.0]])
    before, after = _shown(front), _shown(output)
    assert after[1] < before[1] < 0
    got = _shown(_kept(output, front))
    np.testing.assert_allclose(got[1], before[1], atol=60 * ROUNDING)
    np.testing.assert_allclose(got[[0, 2]], after[[0, 2]], atol=60 * ROUNDING)


def test_what_is_no_lamp_and_what_is_bright_enough_keep_their_bits() -> None:
    front = _stable([[0.3, 0.3, 0.3], [0.9, 0.9, 0.9], [2, 2, 2]])
    output = _stable([[0.9, 0.3, 0.9], [3.0, 0.9, 3.0], [3, 3, 3]])
    assert (_shown(output)[:, :2].min(axis=0) < 0.9).all()
    np.testing.assert_array_equal(_kept(output, front), output)


def test_no_colour_of_the_camera_ends_below_the_front_end_or_white() -> None:
    front, output = _stable([[0.2, 0.9, 1.5], [40, 40, 40]]), _stable([[0.1] * 3, [0.5] * 3])
    for turn in (TURN, np.eye(3)):
        light = unstabilise(_kept(output, front, turn), NOISE, scale=SCALE)[:, 0].T
        wanted = np.minimum([[0.2, 0.9, 1.5], [40, 40, 40]], 1)
        assert (light >= wanted * (1 - ROUNDING)).all()


def test_the_bits_of_a_pixel_do_not_depend_on_those_beside_it() -> None:
    rng = np.random.default_rng(0)
    front, output = (_stable(rng.uniform(0, 8, (200, 3)).tolist()) for _ in range(2))
    whole = _kept(output, front)
    assert (whole != np.maximum(output, np.minimum(front, _stable([[1, 1, 1]])))).any()
    for n in (0, 7, 199):
        part = np.s_[:, :, n : n + 1]
        np.testing.assert_array_equal(_kept(output[part], front[part]), whole[part])


@pytest.mark.parametrize("wild", [np.nan, np.inf, 3e38, 1e25])
def test_a_network_that_explodes_warns_of_nothing_here(wild: float) -> None:
    """The guard of a tile looks at what is not finite."""
    front = _stable([[2, 2, 2], [3, 3, 3]])
    output = _stable([[40, 5, 40], [40, 5, 40]])
    output[:, :, 0] = np.array([wild, 1, wild])[:, None]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        got = _kept(output, front)
    np.testing.assert_array_equal(got[0, 0, 0], output[0, 0, 0])
    assert _shown(got[:, :, 1:]).min() > 1 - ROUNDING


def test_one_channel_has_no_colours() -> None:
    noise = NoiseModel(shot=(1e-4,), read_variance=(1e-6,))
    keeper = white_keeper(noise, SCALE, TURN)
    output, front = np.full((1, 2, 2), 0.1, np.float32), np.full((1, 2, 2), 9.0, np.float32)
    keeper.keep(output, front)
    light = unstabilise(output, noise, scale=SCALE)
    np.testing.assert_allclose(light, 1, rtol=ROUNDING)
