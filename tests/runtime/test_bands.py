"""Whatever makes bands lets go of the one it gave before it makes the next: two are never held."""

import weakref
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from camkit.radial import RadialDistortion
from camkit.runtime.clock import StageClock
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.network.cell_windows import CellLimits, CellNetwork, infer_cells, lay_cells
from camkit.runtime.network.tiling import PixelCost, TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows, Rows, RowSource, changed_bands, read_bands

HEIGHT, WIDTH = 640, 128
CELL_PX = 128


class _Watched(ArrayRows):
    """Rows whose reader must not hold any band that it gave."""

    def __init__(self) -> None:
        super().__init__(np.ones((3, HEIGHT, WIDTH), np.float32))
        self.given: list[weakref.ref[Rows]] = []

    def read(self, top: int, bottom: int) -> Rows:
        assert all(known() is None for known in self.given)
        return super().read(top, bottom).copy()


def _tiles(source: RowSource) -> Iterator[Rows]:
    layout = lay_windows(HEIGHT, WIDTH, TileLimits(stride_px=2, halo_px=0, tile_px=64))
    return infer_bands(np.copy, source, layout)


def _cells(source: RowSource) -> Iterator[Rows]:
    cost = PixelCost(arena_bytes=100.0)
    network = CellNetwork(run=np.copy, stride_px=2, halo_px=0, cost=cost)
    limits = CellLimits(cell_px=CELL_PX, max_bytes=2**32, tile_px=CELL_PX)
    labels = np.ones((HEIGHT // CELL_PX, WIDTH // CELL_PX), np.int8)
    layout = lay_cells((HEIGHT, WIDTH), labels, [network], limits)
    return infer_cells([network], source, layout, stand_in=slice(0, 3))


def _straight(source: RowSource) -> Iterator[Rows]:
    barrel = RadialDistortion(coefficients=np.tile([1.0, 0.01, 0, 0], (3, 1)), radius_mm=0.5)
    size = (WIDTH, HEIGHT)
    window = SensorWindow(origin_px=(0, 0), size_px=size, pitch_um=1.0, sensor_size_px=size)
    return undistort_bands(source, barrel, window)


def _nothing(rows: Rows, top: int) -> None:
    del rows, top


MAKERS: dict[str, Callable[[RowSource], Iterator[Rows]]] = {
    "clock": lambda source: StageClock().bands("made", read_bands(source)),
    "change": lambda source: changed_bands(read_bands(source), _nothing),
    "tiles": _tiles,
    "cells": _cells,
    "undistort": _straight,
}


@pytest.mark.parametrize("maker", MAKERS)
def test_a_band_is_let_go_before_the_next_is_made(maker: str) -> None:
    source = _Watched()
    bands = MAKERS[maker](source)
    while (band := next(bands, None)) is not None:
        source.given.append(weakref.ref(band))
        del band
    assert len(source.given) > 2
