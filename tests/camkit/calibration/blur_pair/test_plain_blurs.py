"""Blurs that know no lens: their transfer is that of what they are called."""

import numpy as np
import pytest

from camkit.calibration.blur_pair.pair_grid import PairGrid
from camkit.calibration.blur_pair.plain_blurs import disc_transfer, gaussian_transfer

GRID = PairGrid(height=100, width=150, side_px=64, halo_px=24)


def test_blocks_tile_the_picture_and_alternate() -> None:
    blocks = GRID.blocks()
    assert len(blocks) == 2 * 3
    assert [block.is_even for block in blocks] == [True, False, True, False, True, False]
    assert (blocks[0].y_px, blocks[0].x_px) == (32 - 50, 32 - 75)
    assert (blocks[-1].y_px, blocks[-1].x_px) == (82 - 50, 139 - 75)
    assert np.array_equal(np.unique(GRID.indices()), np.arange(6))


def test_an_impulse_becomes_a_gaussian_and_a_disc() -> None:
    impulse = np.zeros((1, 100, 150), np.float32)
    impulse[0, 40, 30] = 1.0
    y, x = np.arange(100)[:, None] - 40, np.arange(150)[None] - 30
    gaussian = GRID.blurred(impulse, lambda _block: gaussian_transfer(GRID, 2.0))[0]
    exact = np.exp(-(y**2 + x**2) / 8) / (8 * np.pi)
    inside = np.s_[16:64, 6:54]
    np.testing.assert_allclose(gaussian[inside], exact[inside], atol=1e-5)
    disc = GRID.blurred(impulse, lambda _block: disc_transfer(GRID, 12.0))[0]
    # second moment of an even disc: diameter^2 / 8
    moment = (disc * (y**2 + x**2))[inside].sum() / disc[inside].sum()
    assert moment == pytest.approx(12.0**2 / 8, rel=0.03)


def test_a_shift_reads_the_picture_farther_on() -> None:
    wave = np.cos(2 * np.pi * (np.arange(150) / 25))[None, None] * np.ones((1, 100, 1))
    moved = GRID.blurred(wave.astype(np.float32), lambda _block: GRID.shifted((0.5, 0.0)))[0]
    exact = np.cos(2 * np.pi * ((np.arange(150) + 0.5) / 25))
    np.testing.assert_allclose(moved[50, 20:120], exact[20:120], atol=0.02)
