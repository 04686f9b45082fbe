"""Light spread over a window as if summed kernel by kernel; the transpose is one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import convolve2d

from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.streaks import convolution
from camkit.runtime.kinds.hdr.streaks.convolution import (
    MOST_LIGHTS,
    Convolution,
    FewLights,
    spreading,
)

FLOAT32 = 2e-6
SHAPES = st.tuples(st.integers(1, 12), st.integers(1, 12))


@settings(max_examples=60, deadline=None)
@given(half=st.integers(0, 15), shape=SHAPES, seed=st.integers(0, 99))
def test_light_is_spread_as_by_direct_convolution_and_lost_beyond_the_window(
    half: int, shape: tuple[int, int], seed: int
) -> None:
    """Kernels larger than the window included, on its long side, its short one or both."""
    rng = np.random.default_rng(seed)
    kernel = rng.uniform(0, 1, (2 * half + 1,) * 2).astype(np.float32)
    kernel /= kernel.sum()
    light = rng.uniform(0, 1, shape).astype(np.float32)
    whole = convolve2d(light, kernel, "full")
    wanted = whole[half : half + shape[0], half : half + shape[1]]
    got = Convolution(kernel, shape).spread(light)
    assert got.dtype == np.float32
    np.testing.assert_allclose(got, wanted, atol=FLOAT32)


@settings(max_examples=40, deadline=None)
@given(half=st.integers(0, 15), shape=SHAPES, seed=st.integers(0, 99))
def test_what_is_gathered_is_the_transpose_of_what_is_spread(
    half: int, shape: tuple[int, int], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    kernel = rng.normal(size=(2 * half + 1,) * 2).astype(np.float32)
    light, image = rng.normal(size=(2, *shape)).astype(np.float32)
    both = Convolution(kernel, shape)
    one = np.vdot(both.spread(light).astype(np.float64), image)
    other = np.vdot(light.astype(np.float64), both.gathered(image))
    scale = np.abs(kernel).sum() * np.abs(light).sum()
    assert abs(one - other) < 1e-5 * scale


@settings(max_examples=60, deadline=None)
@given(half=st.integers(0, 15), shape=SHAPES, seed=st.integers(0, 99))
def test_kernels_laid_about_few_lights_do_as_transforms_do(
    half: int, shape: tuple[int, int], seed: int
) -> None:
    """Where lights may be; transposed they say nothing of other places."""
    rng = np.random.default_rng(seed)
    kernel = rng.normal(size=(2 * half + 1,) * 2).astype(np.float32)
    lit = rng.uniform(size=shape) < 0.3
    light, image = rng.normal(size=(2, *shape)).astype(np.float32)
    few, every = FewLights(kernel, lit), Convolution(kernel, shape)
    size = np.abs(kernel).sum() * 4
    there = np.where(lit, light, 0).astype(np.float32)
    np.testing.assert_allclose(few.spread(light), every.spread(there), atol=FLOAT32 * size)
    got = few.gathered(image)
    np.testing.assert_allclose(got[lit], every.gathered(image)[lit], atol=FLOAT32 * size)
    assert (got[~lit] == 0).all()


def test_few_lights_are_spread_one_by_one_and_many_by_transforms(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kernel = np.ones((5, 5), np.float32)
    lit = np.zeros((40, 40), np.bool_)
    lit.ravel()[:MOST_LIGHTS] = True
    assert isinstance(spreading(kernel, lit), FewLights)
    lit[39, 39] = True
    assert isinstance(spreading(kernel, lit), Convolution)
    lit[39, 39] = False
    monkeypatch.setattr(convolution, "MOST_VALUES", MOST_LIGHTS * lit.size - 1)
    assert isinstance(spreading(kernel, lit), Convolution)


def test_a_lone_light_becomes_the_kernel_as_it_lies() -> None:
    """Not flipped: what is right of the middle lies right of the light."""
    kernel = np.arange(9, dtype=np.float32).reshape(3, 3)
    light = np.zeros((5, 6), np.float32)
    light[2, 3] = 1
    wanted = np.zeros((5, 6))
    wanted[1:4, 2:5] = kernel
    np.testing.assert_allclose(Convolution(kernel, (5, 6)).spread(light), wanted, atol=1e-5)
    tip = np.zeros((5, 6), np.float32)
    tip[3, 4] = 1
    assert Convolution(kernel, (5, 6)).gathered(tip)[2, 3] == pytest.approx(kernel[2, 2], abs=1e-5)


@pytest.mark.parametrize("shape", [(4, 4), (3, 5), (3,)])
def test_a_kernel_without_a_middle_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ContractError, match="square with an odd side"):
        Convolution(np.ones(shape, np.float32), (8, 8))


def test_kernels_laid_out_at_once_spread_light_as_those_laid_out_one_by_one() -> None:
    rng = np.random.default_rng(7)
    kernel = rng.uniform(0, 1, (9, 9)).astype(np.float32)
    lit = rng.uniform(0, 1, (12, 17)) > 0.9
    light = np.where(lit, rng.uniform(1, 9, lit.shape), 0).astype(np.float32)
    once, often = FewLights(kernel, lit), FewLights(kernel, lit, often=True)
    np.testing.assert_allclose(often.spread(light), once.spread(light), rtol=1e-5)
    np.testing.assert_array_equal(often.gathered(light), once.gathered(light))
