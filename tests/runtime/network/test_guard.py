"""No bad tile reaches a picture: it is named, and refused or replaced by what stands in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.network.guard import (
    BOUND_FACTOR,
    BOUND_OFFSET,
    DARK_SPREADS,
    TileGuard,
    light_bound,
    plain_bound,
)
from camkit.runtime.network.tiling import TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows
from camkit.runtime.signal.stabilise import DEFAULT_SCALE, stabilise, unstabilise

RNG = np.random.default_rng
RESTORED = slice(3, 6)
"""Channels of the input that stand in for a bad tile."""


def _planes(height: int = 32, width: int = 32) -> np.ndarray:
    return RNG(0).uniform(0, 1, (6, height, width)).astype(np.float32)


def _bands(planes: np.ndarray, spoil: float, guard: TileGuard | None) -> np.ndarray:
    """Run a 'network' that copies the capture and spoils tiles with a sample above 2."""

    def run(window: np.ndarray) -> np.ndarray:
        out = window[:, :3].copy()
        out[window[:, :3] > 2] = spoil
        return out

    limits = TileLimits(stride_px=2, halo_px=0, tile_px=16)
    layout = lay_windows(planes.shape[1], planes.shape[2], limits)
    bands = infer_bands(run, ArrayRows(planes), layout, guard=guard)
    return np.concatenate(list(bands), axis=1)


def test_sound_tiles_pass_untouched() -> None:
    planes, guard = _planes(), TileGuard(fallback=True, stand_in=RESTORED)
    np.testing.assert_array_equal(_bands(planes, np.nan, guard), planes[:3])
    assert guard.replaced == []


@pytest.mark.parametrize("spoil", [np.nan, np.inf, -np.inf, 1e4])
def test_a_bad_tile_takes_the_planes_that_stand_in_and_only_it(spoil: float) -> None:
    planes, guard = _planes(), TileGuard(fallback=True, stand_in=RESTORED)
    planes[1, 20, 5] = 3.0
    got = _bands(planes, spoil, guard)
    expected = planes[:3].copy()
    expected[:, 16:, :16] = planes[3:, 16:, :16]
    np.testing.assert_array_equal(got, expected)
    assert len(guard.replaced) == 1
    assert "tile (row 1, column 0), pixels x 0..16, y 16..32" in guard.replaced[0]


@pytest.mark.parametrize(("spoil", "what"), [(np.nan, "NaN or inf"), (1e4, "values up to 1e")])
def test_without_fallback_the_tile_is_named_in_the_error(spoil: float, what: str) -> None:
    planes = _planes()
    planes[0, 3, 30] = 3.0
    with pytest.raises(ContractError, match=rf"{what}.*tile \(row 0, column 1\).*x 16..32, y 0"):
        _bands(planes, spoil, TileGuard(fallback=False))


def test_without_a_guard_nan_is_still_refused_and_large_values_pass() -> None:
    planes = _planes()
    planes[0, 3, 30] = 3.0
    with pytest.raises(ContractError, match=r"NaN or inf in tile \(row 0, column 1\)"):
        _bands(planes, np.nan, None)
    assert _bands(planes, 1e4, None).max() == np.float32(1e4)


def test_planes_that_are_not_finite_cannot_stand_in() -> None:
    planes, guard = _planes(), TileGuard(fallback=True, stand_in=RESTORED)
    planes[0, 3, 30], planes[4, 0, 31] = 3.0, np.nan
    with pytest.raises(ContractError, match="not finite either"):
        _bands(planes, np.nan, guard)


def test_the_bound_grows_with_the_input() -> None:
    guard = TileGuard(fallback=False)
    for level in (0.1, 1.0, 50.0):
        tile = np.full((6, 4, 4), level, np.float32)
        bound = BOUND_FACTOR * level + BOUND_OFFSET
        inside = np.full((3, 4, 4), 0.999 * bound, np.float32)
        assert guard.check(inside, tile, lambda: "tile") is inside
        for sign in (1, -1):
            with pytest.raises(ContractError, match="beyond"):
                guard.check(sign * 1.01 * inside, tile, lambda: "tile")


def _fine_bands(planes: np.ndarray, guard: TileGuard, scale: int = 2) -> np.ndarray:
    """Run a 'network' that repeats the capture to twice its size and spoils samples above 2."""

    def run(window: np.ndarray) -> np.ndarray:
        out = window[:, :3].repeat(scale, axis=2).repeat(scale, axis=3)
        out[out > 2] = np.nan
        return out

    layout = lay_windows(*planes.shape[1:], TileLimits(stride_px=2, halo_px=0, tile_px=16))
    bands = infer_bands(run, ArrayRows(planes), layout, guard=guard, scale=scale)
    return np.concatenate(list(bands), axis=1)


def test_a_bad_tile_of_a_finer_output_is_named_by_its_place_in_the_input() -> None:
    planes, guard = _planes(), TileGuard(fallback=True)
    np.testing.assert_array_equal(
        _fine_bands(planes, guard), planes[:3].repeat(2, axis=1).repeat(2, axis=2)
    )
    planes[1, 20, 5] = 3.0
    with pytest.raises(ContractError, match=r"pixels x 0..16, y 16..32") as caught:
        _fine_bands(planes, TileGuard(fallback=True))
    assert "on_unsafe" not in str(caught.value), "nothing stands in for twice the samples"


def test_the_factor_of_the_bundle_widens_the_bound() -> None:
    given = np.full((6, 4, 4), 0.5, np.float32)
    bright = np.full((3, 8, 8), 100.0, np.float32)
    assert (
        TileGuard(fallback=False, bound=plain_bound(256.0)).check(bright, given, lambda: "t")
        is bright
    )
    with pytest.raises(ContractError, match="beyond"):
        TileGuard(fallback=False).check(bright, given, lambda: "t")


@pytest.mark.parametrize("stand_in", [slice(0, 1), slice(2, 6)])
def test_any_channels_of_the_input_may_stand_in(stand_in: slice) -> None:
    given = np.random.default_rng(0).random((6, 4, 4)).astype(np.float32)
    guard = TileGuard(fallback=True, stand_in=stand_in)
    bad = np.full((stand_in.stop - stand_in.start, 4, 4), np.inf, np.float32)
    np.testing.assert_array_equal(guard.check(bad, given, lambda: "tile"), given[stand_in])
    assert guard.replaced == ["tile: NaN or inf"]


@given(
    shot=st.floats(1e-6, 0.1),
    read_e=st.floats(0, 300),
    largest=st.floats(0, 1),
    most=st.sampled_from([16.0, 256.0]),
)
def test_light_is_bounded_whatever_the_noise_says(
    shot: float, read_e: float, largest: float, most: float
) -> None:
    """In light: at most `most` times the largest input, at least as far below black, and noise."""
    noise = NoiseModel(shot=(shot,) * 3, read_variance=((read_e * shot) ** 2,) * 3)
    stable = stabilise(np.full((3, 1, 1), largest, np.float32), noise)
    ends = light_bound(most, noise, scale=DEFAULT_SCALE)(float(stable.max()))
    low, high = (
        float(unstabilise(np.full((3, 1, 1), end, np.float32), noise)[0, 0, 0]) for end in ends
    )
    dark = DARK_SPREADS * (read_e + 1) * shot
    rounding = 1e-3 * (largest + dark + read_e**2 * shot)
    assert high <= most * largest + dark + most * rounding
    assert low >= -(largest + dark) - rounding


def test_a_flat_square_root_hides_no_light() -> None:
    """A noise model off by far: a third of the stabilised signal is many times the white level."""
    noise = NoiseModel(shot=(1e-4,) * 3, read_variance=((1000 * 1e-4) ** 2,) * 3)
    given_ = stabilise(
        np.full((6, 4, 4), 0.1, np.float32),
        NoiseModel(shot=noise.shot * 2, read_variance=noise.read_variance * 2),
    )[None]
    guard = TileGuard(fallback=False, bound=light_bound(16.0, noise, scale=DEFAULT_SCALE))
    assert guard.check(given_[:, :3], given_, lambda: "tile") is not None
    for wrong in (2.0 * given_[:, :3], 0.8 * given_[:, :3]):
        with pytest.raises(ContractError, match="beyond"):
            guard.check(wrong, given_, lambda: "tile")
