"""Cells are the plain means of the samples of a colour, read in whatever order rows stream."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CFA_PATTERNS, CfaPattern, cfa_channels
from camkit.runtime.bank.cell_means import cell_count, cell_means
from camkit.runtime.rows import ArrayRows

FLOAT32 = 1e-6
Mask = NDArray[np.bool_]


def _slowly(
    planes: FloatArray, over: Mask, cfa: CfaPattern | None, cell_px: int
) -> tuple[FloatArray, Mask]:
    """Look at every pixel of every cell."""
    count, height, width = planes.shape
    channels = 3 if cfa else count
    rows, columns = cell_count(height, cell_px), cell_count(width, cell_px)
    means, hit = np.zeros((channels, rows, columns)), np.zeros((channels, rows, columns), bool)
    for channel in range(channels):
        for row in range(rows):
            for column in range(columns):
                found = []
                for y in range(height):
                    for x in range(width):
                        inside = (min(y // cell_px, rows - 1), min(x // cell_px, columns - 1))
                        if inside != (row, column):
                            continue
                        if cfa and cfa_channels(cfa)[y % 2][x % 2] != channel:
                            continue
                        found.append(float(planes[0 if cfa else channel, y, x]))
                        hit[channel, row, column] |= over[0 if len(over) == 1 else channel, y, x]
                means[channel, row, column] = np.mean(found) if found else 0
    return means.astype(np.float32), hit


@settings(max_examples=25, deadline=None)
@given(
    height=st.integers(1, 21),
    width=st.integers(1, 21),
    cfa=st.sampled_from([None, *CFA_PATTERNS]),
    cell_px=st.sampled_from([4, 8]),
    seed=st.integers(0, 99),
)
def test_cells_are_means(
    height: int, width: int, cfa: CfaPattern | None, cell_px: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    planes = rng.random((1 if cfa else 2, height, width), dtype=np.float32)
    over = rng.random((1, height, width)) < 0.05
    wanted, hit = _slowly(planes, over, cfa, cell_px)
    means, clipped = cell_means(ArrayRows(planes), ArrayRows(over), cfa, cell_px)
    np.testing.assert_allclose(means, wanted, rtol=FLOAT32)
    np.testing.assert_array_equal(clipped, hit)


@pytest.mark.parametrize(("side", "cells"), [(1, 1), (7, 1), (11, 1), (12, 2), (16, 2), (19, 2)])
def test_what_is_left_over_is_a_cell_from_half_a_cell_on(side: int, cells: int) -> None:
    assert cell_count(side, 8) == cells


def test_what_is_no_number_is_dark() -> None:
    planes = np.array([[[np.nan, 1.0], [np.inf, 1.0]], [[-np.inf, 0.0], [0.5, 0.5]]], np.float32)
    means, clipped = cell_means(ArrayRows(planes), None, None, 4)
    assert means.ravel().tolist() == [0.75, 0.25]
    assert not clipped.any()


class _OneRowOfCells(ArrayRows):
    """Rows that are never read beyond a row of cells."""

    def read(self, top: int, bottom: int) -> FloatArray:
        assert bottom - top <= 8 + 4
        assert top % 8 == 0
        return super().read(top, bottom)


def test_no_more_than_a_row_of_cells_is_read_at_once() -> None:
    planes = np.random.default_rng(0).random((1, 44, 40), dtype=np.float32)
    means, _ = cell_means(_OneRowOfCells(planes), None, "GRBG", 8)
    assert means.shape == (3, 6, 5)
    alone, _ = cell_means(ArrayRows(planes[:, 16:24]), None, "GRBG", 8)
    np.testing.assert_array_equal(means[:, 2:3], alone)
