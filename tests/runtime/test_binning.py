"""Averages over squares of a mosaic: where a colour's mean lies, its noise, its detail."""

import numpy as np
import pytest

from camkit.cfa import CFA_PATTERNS, CfaPattern
from camkit.errors import ContractError
from camkit.runtime.binning import COLOURS, Binning


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize("side", [2, 4])
def test_sites_of_all_colours_fill_the_square_once(cfa: CfaPattern, side: int) -> None:
    binning = Binning(side_px=side, cfa=cfa)
    sites = [site for colour in range(COLOURS) for site in binning.sites(colour)]
    assert sorted(sites) == [(y, x) for y in range(side) for x in range(side)]
    counts = [len(binning.sites(colour)) for colour in range(COLOURS)]
    assert counts == [side**2 // 4, side**2 // 2, side**2 // 4]


@pytest.mark.parametrize("side", [2, 4])
def test_green_stays_and_red_moves_by_half_a_pixel(side: int) -> None:
    binning = Binning(side_px=side, cfa="RGGB")
    assert binning.shift_px(1) == (0.0, 0.0)
    assert binning.shift_px(0) == (0.5, 0.5)
    assert binning.shift_px(2) == (-0.5, -0.5)
    assert binning.shift_weights(0)[0] == pytest.approx([0, 1 - 0.5 / side, 0.5 / side])


def test_noise_is_that_of_the_weighted_samples() -> None:
    binning = Binning(side_px=2, cfa="GRBG")
    moved = (0.75**2 + 0.25**2) ** 2
    assert binning.noise_factors == pytest.approx((moved, 0.5, moved))


@pytest.mark.parametrize("side", [2, 4])
def test_transfer_is_that_of_a_wave(side: int) -> None:
    """A wave down the rows, averaged as red is, over the same wave averaged as the picture is."""
    binning, frequency, count = Binning(side_px=side, cfa="RGGB"), 0.07, 64
    wave = np.exp(2j * np.pi * frequency * np.arange(count * side)).reshape(count, side)
    rows = sorted({row for row, _ in binning.sites(0)})
    red = np.convolve(wave[:, rows].mean(axis=1), binning.shift_weights(0)[0][::-1], "same")
    ratio = abs(red[count // 2]) / abs(wave.mean(axis=1)[count // 2])
    assert binning.transfer(0, np.array([frequency]))[0] == pytest.approx(ratio, rel=1e-6)
    assert binning.transfer(1, np.array([0.0, frequency])) == pytest.approx([1.0, 1.0])


def test_squares_of_odd_sides_are_refused() -> None:
    with pytest.raises(ContractError, match="got 3 px"):
        Binning(side_px=3, cfa="RGGB")
