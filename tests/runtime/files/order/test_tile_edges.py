"""A tile that broke has an edge along its border; edges of the scene are none."""

import numpy as np
import pytest

from camkit.runtime.files.doubts import find_doubts
from camkit.runtime.files.order.tile_edges import TileGrid
from tests.runtime.files.order.test_row_order import LEVELS, PATTERNS, mosaic_of, photograph

GRID = TileGrid(size=(10_000, 100), first=(0, 0))


def edges(mosaic, grid=GRID):
    found = find_doubts(mosaic, LEVELS, "RGGB", grid=grid)
    return [doubt for doubt in found if "edge along its border" in doubt]


@pytest.mark.parametrize("change", [600, "white", "grey"])
@pytest.mark.parametrize("first_row", [60, 150])
@pytest.mark.parametrize("tile", [0, 1, 3])
def test_a_tile_that_breaks_off_is_named(change, first_row, tile):
    mosaic = mosaic_of(photograph(2))
    assert edges(mosaic) == []
    part = mosaic[first_row:, tile * 100 : (tile + 1) * 100]
    levels = {"white": 4095, "grey": 2000}
    part[:] = levels.get(change) or np.clip(part.astype(int) + change, 0, 4095)
    assert len(edges(mosaic)) == 1


def test_borders_are_counted_from_the_first_visible_pixel():
    mosaic = mosaic_of(photograph(2))
    mosaic[150:, 100:] = 4095
    assert edges(mosaic, TileGrid(size=(10_000, 110), first=(4, 10)))
    assert not edges(mosaic, TileGrid(size=(10_000, 110), first=(4, 0)))


@pytest.mark.parametrize("name", PATTERNS)
def test_patterns_are_no_broken_tiles(name):
    light = np.kron(0.1 + 0.7 * np.asarray(PATTERNS[name], dtype=np.float64), np.ones((2, 2)))
    for size in ((10_000, 128), (256, 256), (10_000, 200)):
        assert edges(mosaic_of(light), TileGrid(size=size, first=(0, 0))) == []
