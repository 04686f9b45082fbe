"""What a picture proves of its lights stands; what it does not prove is left as it was seen."""

import numpy as np
import pytest
import scipy.ndimage
import scipy.signal
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.convolution import Convolution
from camkit.runtime.kinds.hdr.streaks.light_evidence import (
    ENOUGH,
    NOTHING,
    SCALE,
    Judge,
    Proven,
    proven,
    share_of,
)
from tests.streak_factory import star_kernels, street

Mask = NDArray[np.bool_]
SHAPE = (60, 84)
KERNEL = star_kernels(None).coarse.whole[1]


def _disc(y: int, x: int, radius: float, light: float) -> FloatArray:
    rows, columns = np.indices(SHAPE)
    return np.where(np.hypot(rows - y, columns - x) <= radius, light, 0).astype(np.float32)


def _scene() -> FloatArray:
    """Give the light of cells of 4 px."""
    street_px = street(4 * SHAPE[0], 4 * SHAPE[1], 3)[1]
    cells = street_px.reshape(SHAPE[0], 4, SHAPE[1], 4).mean((1, 3))
    return np.asarray(cells, np.float32)


def _spread(light: FloatArray) -> FloatArray:
    whole = scipy.signal.fftconvolve(light, KERNEL.astype(np.float64))
    half = KERNEL.shape[0] // 2
    return np.asarray(whole[half : half + SHAPE[0], half : half + SHAPE[1]])


def _judge(light: FloatArray, seen: FloatArray) -> Judge:
    return Judge(light, seen - Convolution(KERNEL, SHAPE).spread(light), KERNEL)


def _proven(light: FloatArray, seen: FloatArray) -> tuple[FloatArray, int]:
    """Prove the lights of a picture that clipped in green alone."""
    dark = np.zeros_like(light)
    every = np.stack([dark, light, dark])
    found = proven(every, [None, _judge(light, seen), None])
    left = found.part_of(every)
    assert not left[[0, 2]].any()
    return left[1], found.given_up


def _slow_cost(rest: FloatArray, clipped: Mask) -> float:
    """Sum the cost over the whole window, gradient by gradient."""
    told = ~scipy.ndimage.binary_dilation(clipped, np.ones((3, 3), np.bool_))
    total = 0.0
    for y in range(SHAPE[0]):
        for x in range(SHAPE[1]):
            for other in ((y + 1, x), (y, x + 1)):
                if other[0] < SHAPE[0] and other[1] < SHAPE[1] and told[y, x] and told[other]:
                    u = ((rest[other] - rest[y, x]) / SCALE) ** 2
                    total += u / (1 + u)
    return total


@pytest.mark.parametrize("place", [(30, 40), (2, 3), (57, 80)], ids=["inside", "corner", "end"])
def test_a_light_keeps_what_the_whole_window_would_cost_more_without_it(
    place: tuple[int, int],
) -> None:
    """The evidence is summed about the place alone; the slow sum looks everywhere."""
    other = _disc(30, 12, 1.5, 30)
    for size in (2.0, 3.0, 5.0, 8.0):
        light = _disc(*place, 1.5, size) + other
        seen = (_scene() + 0.6 * _spread(light)).astype(np.float32)
        own = np.where((light > 0) & (other == 0), light - 1, 0)
        rest = seen - _spread(light)
        clipped = light > 0
        evidence = _slow_cost(rest + _spread(own), clipped) - _slow_cost(rest, clipped)
        wanted = 1 + (size - 1) * share_of(evidence)
        found, _ = _proven(light, seen)
        assert found[place] == pytest.approx(wanted, rel=2e-3)


def test_a_lamp_whose_streaks_are_seen_stands_as_it_was_found() -> None:
    light = _disc(30, 40, 1.5, 80) + _disc(10, 12, 0.5, 150)
    found, given_up = _proven(light, (_scene() + _spread(light)).astype(np.float32))
    np.testing.assert_array_equal(found, light)
    assert given_up == 0


def test_a_light_without_streaks_is_left_as_it_was_seen() -> None:
    """The picture shows the streaks of one of two lights."""
    true, invented = _disc(30, 30, 1.5, 80), _disc(12, 66, 2.5, 12)
    seen = (_scene() + _spread(true + (invented > 0))).astype(np.float32)
    found, given_up = _proven(true + invented, seen)
    assert given_up == 1
    np.testing.assert_allclose(found[invented > 0], 1)
    np.testing.assert_array_equal(found[true > 0], true[true > 0])


def test_nothing_is_raised_and_what_was_not_brighter_than_white_is_kept() -> None:
    rng = np.random.default_rng(0)
    light = np.where(_disc(30, 30, 6, 1) + _disc(12, 66, 3, 1) > 0, rng.uniform(0.1, 6, SHAPE), 0)
    light = light.astype(np.float32)
    found, _ = _proven(light, _scene())
    assert (found <= light).all()
    np.testing.assert_array_equal(found[light <= 1], light[light <= 1])
    assert (found[light > 1] >= 1 - 1e-6).all()


def test_a_window_without_an_excess_is_left_alone() -> None:
    light = _disc(30, 30, 3, 1)
    found, given_up = _proven(light, _scene())
    np.testing.assert_array_equal(found, light)
    assert given_up == 0


def test_what_one_colour_proves_speaks_for_the_others() -> None:
    """The streaks of green are seen by far, those of a dim blue hardly."""
    lights = [_disc(30, 30, 1.5, size) for size in (80.0, 3.0)]
    judges = [_judge(x, (_scene() + _spread(x)).astype(np.float32)) for x in lights]
    both = np.stack([*lights, np.zeros(SHAPE, np.float32)])
    np.testing.assert_array_equal(proven(both, [*judges, None]).part_of(both), both)
    dim = np.stack([both[2], lights[1], both[2]])
    assert proven(dim, [None, judges[1], None]).part_of(dim).max() < 3


def test_what_is_proven_in_coarse_cells_holds_for_the_finer_ones_that_they_cover() -> None:
    coarse = Proven(share=np.array([[1.0, 0.0], [0.5, 1.0]], np.float32), given_up=1)
    fine = coarse.finer((5, 4))
    assert fine.given_up == 1
    wanted = [[1, 1, 0, 0]] * 2 + [[0.5, 0.5, 1, 1]] * 3
    np.testing.assert_array_equal(fine.share, wanted)
    np.testing.assert_array_equal(fine.part_of(np.full((5, 4), 5, np.float32)), 1 + 4 * fine.share)


@pytest.mark.parametrize(
    ("evidence", "share"),
    [(-3, 0), (NOTHING, 0), ((NOTHING + ENOUGH) / 2, 0.5), (ENOUGH, 1), (1e4, 1)],
)
def test_the_share_rises_with_the_evidence(evidence: float, share: float) -> None:
    assert share_of(evidence) == pytest.approx(share)
