"""Pictures in windows and whole, on which a network must agree, and what it is given there."""

import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.reader import Bundle
from camkit.runtime.device.case_results import GoldenRun, golden_arrays
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.tiling import TileLayout, TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows

SEED: Final = 7
TILES_PX: Final = (64, 40, 1)
"""Sides of the tiles tried, whole cells of the stride: an odd number of them but for the first."""
_SYNTHETIC_PX: Final = 96
_SYNTHETIC_MOST: Final = 8.0


def tiles_px(stride: int) -> tuple[int, ...]:
    """Return three sides of tiles on the lattice of a stride.

    Origins of tiles of an odd number of cells, one cell among them, come to lie on every phase of
    a lattice that is twice or four times as coarse: what is exact on multiples of 64 px alone is
    found out.
    """
    first, *others = TILES_PX
    cells = {math.ceil(first / stride), *(px // stride | 1 for px in others)}
    more = (count for count in range(1, 4) if count not in cells)
    while len(cells) < len(TILES_PX):
        cells.add(next(more))
    return tuple(count * stride for count in sorted(cells))


def picture_px(facts: NetworkFacts, tile: int) -> tuple[int, int]:
    """Return odd sides (h, w) that need at least 2 x 2 windows."""
    stride, wide = facts.stride_px, max(tiles_px(facts.stride_px))
    halo = math.ceil(facts.reach_px / stride) * stride
    return 2 * (halo + tile) + stride + 1, 2 * halo + wide + 2 * stride + 3


def compared_layouts(facts: NetworkFacts) -> Iterator[tuple[TileLayout, TileLayout]]:
    """Plan the compared windows: tiled and whole, at every side of a tile, the smallest first."""
    limits = TileLimits(
        stride_px=facts.stride_px, halo_px=facts.reach_px, max_bytes=sys.maxsize, whole=True
    )
    for tile in tiles_px(facts.stride_px):
        size = picture_px(facts, tile)
        tiled = lay_windows(*size, replace(limits, whole=False, tile_px=tile))
        yield tiled, lay_windows(*size, limits)


def continued(sample: FloatArray, layout: TileLayout) -> FloatArray:
    """Return planes as a picture of the size of a layout, mirrored where they are smaller."""
    height, width = layout.height_px, layout.width_px
    pads = [(0, 0), (0, max(0, height - sample.shape[1])), (0, max(0, width - sample.shape[2]))]
    return np.pad(sample, pads, mode="symmetric")[:, :height, :width]


def infer(engine: NetworkEngine, picture: FloatArray, layout: TileLayout) -> FloatArray:
    """Return (outputs, s h, s w) of a network on a picture, by the windows of a layout."""
    rows = ArrayRows(np.ascontiguousarray(picture))
    bands = infer_bands(engine.run, rows, layout, scale=engine.scale)
    return np.concatenate(list(bands), axis=1)


def network_windows(
    bundle: Bundle, role: str, size: str, run: GoldenRun | None
) -> Iterator[FloatArray]:
    """Yield inputs of a network, (c, h, w): those of the golden captures, else noise."""
    facts = bundle.network_facts(role, size)
    if run is None or not bundle.manifest.golden:
        yield noise_planes(facts)
        return
    arrays = golden_arrays(bundle)
    for case in bundle.manifest.golden:
        planes = run(bundle, case, arrays[case.name], size).network_input(role)
        yield np.ascontiguousarray(_whole_cells(planes, facts.stride_px))


def noise_planes(facts: NetworkFacts) -> FloatArray:
    """Return noise as the input of a network."""
    side = math.ceil(_SYNTHETIC_PX / facts.stride_px) * facts.stride_px
    rng = np.random.default_rng(SEED)
    planes = rng.random((facts.input_channels, side, side), dtype=np.float32)
    return np.float32(_SYNTHETIC_MOST) * planes


def _whole_cells(planes: FloatArray, stride: int) -> FloatArray:
    """Cut planes to multiples of the stride; those smaller than a cell are continued to one."""
    missing = [(0, max(0, stride - side)) for side in planes.shape[1:]]
    if any(pad for _, pad in missing):
        planes = np.pad(planes, [(0, 0), *missing], mode="edge")
    _, height, width = planes.shape
    return planes[:, : height // stride * stride, : width // stride * stride]
