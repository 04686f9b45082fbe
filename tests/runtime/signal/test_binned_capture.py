"""A binned capture is the mosaic's light at half or a quarter of its size."""

import numpy as np
import pytest

from camkit.cfa import CFA_PATTERNS, CfaPattern
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.geometry.shrink import shrunk
from camkit.runtime.signal.binned_capture import binned_capture
from camkit.runtime.twin.exposure import sample_mosaic
from tests.job_factory import made_mosaic, made_planes

STEP = 1 / 60_000
"""Of light between two numbers of a binned sample, and a little more."""


def _mosaic_of(planes: np.ndarray, cfa: CfaPattern = "RGGB") -> np.ndarray:
    light = sample_mosaic(planes.astype(np.float32), cfa, (1.0, 1.0, 1.0))
    return np.asarray(64 + light * (1023 - 64), np.float32)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize("side", [2, 4])
def test_a_ramp_stays_where_it_is_in_every_colour(cfa: CfaPattern, side: int) -> None:
    y, x = np.mgrid[:32, :48]
    ramp = np.stack([0.1 + 0.01 * x + 0.005 * y] * 3)
    capture = made_mosaic(samples=_mosaic_of(ramp, cfa), cfa=cfa)
    small = binned_capture(capture, side).linear_rows(0, 32 // side)
    inner = np.s_[:, 1:-1, 1:-1]
    np.testing.assert_allclose(small[inner], shrunk(ramp, side)[inner], atol=STEP)


def test_flat_stays_flat_and_noise_below_black_is_kept() -> None:
    for level in (0.5, -0.03):
        samples = np.full((8, 12), 64 + level * (1023 - 64), np.float32)
        small = binned_capture(made_mosaic(samples=samples), 2)
        np.testing.assert_allclose(small.linear_rows(0, 4), level, atol=STEP)
        assert not small.saturated_rows(0, 4).any()


def test_a_square_with_a_clipped_sample_is_white_in_its_colour_alone() -> None:
    samples = np.full((8, 8), 300, np.uint16)
    samples[4, 4] = 1023
    small = binned_capture(made_mosaic(samples=samples), 2)
    clipped = small.saturated_rows(0, 4)
    assert clipped.sum() == 1
    assert clipped[0, 2, 2]
    assert small.linear_rows(0, 4)[0, 2, 2] == 1


def test_white_stays_white() -> None:
    small = binned_capture(made_mosaic(samples=np.full((8, 8), 1023, np.uint16)), 4)
    assert small.saturated_rows(0, 2).all()


def test_what_fills_no_square_is_left_out_and_the_noise_becomes_that_of_means() -> None:
    noise = NoiseModel(shot=(1e-3,) * 3, read_variance=(1e-6,) * 3)
    small = binned_capture(made_mosaic(samples=np.full((10, 13), 300, np.uint16), noise=noise), 4)
    assert small.samples.shape == (3, 2, 3)
    assert small.binning is not None
    assert small.noise == noise.raised(small.binning.noise_factors)
    assert small.is_of_mosaic


def test_invalid_samples_count_as_black_and_threads_change_no_bit() -> None:
    samples = np.random.default_rng(1).uniform(64, 900, (64, 64)).astype(np.float32)
    samples[3, 3] = np.nan
    one, two = (binned_capture(made_mosaic(samples=samples), 2, threads=n) for n in (1, 3))
    assert (one.samples == two.samples).all()


def test_planes_and_pictures_smaller_than_a_square_are_refused() -> None:
    with pytest.raises(ContractError, match="need a mosaic"):
        binned_capture(made_planes(), 2)
    with pytest.raises(ContractError, match="with at least one"):
        binned_capture(made_mosaic(samples=np.ones((2, 8), np.uint16)), 4)
