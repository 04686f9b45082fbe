"""Lights of cells as lights of pixels: where samples clipped, shaped alike in all colours.

    cells and which of their samples clipped -> pixels of each colour that are lit
    lights of cells, smoothed, lower at rims  -> shape of every place, in each colour and in all
    light of a place                          -> is shared out by the shape: none is lost or made

A mosaic samples red and blue at every fourth pixel. A pixel between them is lit if both sides
clipped, or if one did and its own sample, of another colour, clipped as well.

References: Sun 2021, chapter 5, gives pixels their light by a network; this stands before one.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.streaks.cells import COLOURS, PITCH_PX, Cells
from camkit.streaks.recovery import Recovery, Region

SEEN: Final = 0.98
"""Of where samples clip: a pixel between samples that is darker did not, it was seen."""
SMOOTHING_CELLS: Final = 0.4
DEEPEST: Final = 2.0
"""A light rises from its rim to this many times as much."""
ALIKE: Final = 0.7
"""Share of a light whose shape is that of all colours together."""
STRIP_CELLS: Final = 2**18
"""Cells about lights that are looked at at once."""
_EIGHT: Final = np.ones((3, 3), np.int8)
_TINY: Final = 1e-12
Mask = NDArray[np.bool_]
Index = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class LitPixels:
    """Pixels that have a light in some colour, from top to bottom.

    Attributes:
        rows: (n,).
        columns: (n,).
        light: (3, n) float32, 1.0 where samples clip; 0 in colours that keep what was seen.
    """

    rows: Index
    columns: Index
    light: FloatArray


def lit_pixels(recovery: Recovery) -> LitPixels:
    """Give the pixels of all lights."""
    none = np.zeros(0, np.int32)
    parts = [LitPixels(rows=none, columns=none, light=np.zeros((COLOURS, 0), np.float32))]
    parts += [_region_pixels(region, recovery.fine) for region in recovery.regions]
    rows = np.concatenate([part.rows for part in parts])
    order = np.argsort(rows, kind="stable")
    return LitPixels(
        rows=rows[order],
        columns=np.concatenate([part.columns for part in parts])[order],
        light=np.concatenate([part.light for part in parts], axis=1)[:, order],
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Places:
    """Cells of a window by the connected place that they belong to.

    Attributes:
        numbers: (h, w) int32, from 1; also of the cells beside a place.
        light: (3, places + 1): of every place in all, per colour, in pixels.
    """

    numbers: Index
    light: FloatArray


def _region_pixels(region: Region, cells: Cells) -> LitPixels:
    clipped = cells.clipped[(slice(None), *region.window.at)]
    places = _places(clipped, region.light)
    lit = _lit(places.numbers, cells, region)
    rows, columns, numbers, shapes = _shaped(places.numbers, lit, cells, region)
    light = _shared_out(shapes, numbers, places.light)
    return LitPixels(
        rows=rows + np.int32(PITCH_PX * region.window.top),
        columns=columns + np.int32(PITCH_PX * region.window.left),
        light=light,
    )


def _places(clipped: FloatArray, light: FloatArray) -> _Places:
    labels, count = scipy.ndimage.label((clipped > 0).any(axis=0), structure=_EIGHT)
    flat = labels.ravel()
    sums = [np.bincount(flat, plane.ravel(), count + 1) for plane in light]
    wide = scipy.ndimage.maximum_filter(labels, size=3)
    return _Places(
        numbers=np.asarray(wide, np.int32),
        light=np.asarray(sums, np.float32) * np.float32(PITCH_PX**2),
    )


def _lit(numbers: Index, cells: Cells, region: Region) -> Mask:
    """Tell which pixels of a window are lit in each colour: (3, h + 2, w + 2), a rim of False."""
    height, width = (PITCH_PX * side for side in numbers.shape)
    lit = np.zeros((COLOURS, height + 2, width + 2), np.bool_)
    at = (slice(None), *region.window.at)
    clipped, pixels = cells.clipped[at], cells.pixels[at]
    level = cells.light[at] * (1 - clipped) + clipped
    for rows, columns in _pixels_of(numbers):
        for colour in range(COLOURS):
            offset = cells.offset_px[colour]
            own = _own(pixels[min(colour, len(pixels) - 1)], rows, columns)
            full = _between(level[colour], rows, columns, offset) >= SEEN
            near = _between(clipped[colour], rows, columns, offset) > 0
            lit[colour, rows + 1, columns + 1] = near & (own | full)
    return lit


def _shaped(
    numbers: Index, lit: Mask, cells: Cells, region: Region
) -> tuple[Index, Index, Index, FloatArray]:
    """Give rows, columns and places (n,) of lit pixels, and the shapes (3, n) of their lights."""
    clipped = cells.clipped[(slice(None), *region.window.at)]
    fields = [_smoothed(*planes) for planes in zip(region.light, clipped, strict=True)]
    none = np.zeros(0, np.int32)
    found = [(none, none, none, np.zeros((COLOURS, 0), np.float32))]
    for rows, columns in _pixels_of(numbers):
        some = lit[:, rows + 1, columns + 1].any(axis=0)
        y, x = rows[some], columns[some]
        shape = np.empty((COLOURS, y.size), np.float32)
        for colour, field in enumerate(fields):
            shape[colour] = _between(field, y, x, cells.offset_px[colour])
            shape[colour] *= _depth(lit[colour], y, x)
        found.append((y, x, numbers[y // PITCH_PX, x // PITCH_PX], shape))
    rows, columns, of_place = (np.concatenate([part[i] for part in found]) for i in range(3))
    return rows, columns, of_place, np.concatenate([part[3] for part in found], axis=1)


def _shared_out(shapes: FloatArray, numbers: Index, light: FloatArray) -> FloatArray:
    """Give lights (3, n) of these shapes (3, n) whose sums in each place are as stated.

    Args:
        shapes: 0 where a colour is not lit.
        numbers: (n,) of the places.
        light: (3, places + 1).
    """
    own = np.stack([_summing_to(s, numbers, f) for s, f in zip(shapes, light, strict=True)])
    every, whole = own.sum(axis=0), np.maximum(light.sum(axis=0), _TINY)
    out = np.empty_like(own)
    for colour, wanted in enumerate(light):
        alike = np.where(shapes[colour] > 0, every * (wanted / whole)[numbers], 0)
        mixed = (1 - ALIKE) * own[colour] + ALIKE * _summing_to(alike, numbers, wanted)
        out[colour] = np.where(shapes[colour] > 0, np.maximum(mixed, 1), 0)
    return out


def _summing_to(shape: FloatArray, numbers: Index, wanted: FloatArray) -> FloatArray:
    there = np.bincount(numbers, shape, wanted.size)
    factor = np.divide(wanted, there, out=np.zeros(wanted.size), where=there > _TINY)
    return np.asarray(shape * factor[numbers], np.float32)


def _pixels_of(numbers: Index) -> Iterator[tuple[Index, Index]]:
    """Yield rows and columns of the pixels of cells that belong to a place, some at a time."""
    width = numbers.shape[1]
    cells = np.flatnonzero(numbers)
    dy, dx = np.divmod(np.arange(PITCH_PX**2, dtype=np.int32), np.int32(PITCH_PX))
    for first in range(0, cells.size, STRIP_CELLS):
        y, x = np.divmod(cells[first : first + STRIP_CELLS].astype(np.int32), np.int32(width))
        yield (
            (PITCH_PX * y[:, None] + dy).ravel(),
            (PITCH_PX * x[:, None] + dx).ravel(),
        )


def _own(pixels: NDArray[np.uint8], rows: Index, columns: Index) -> Mask:
    """Tell of pixels whether their own sample clipped."""
    bit = (rows % PITCH_PX) * PITCH_PX + columns % PITCH_PX
    return (pixels[rows // PITCH_PX, columns // PITCH_PX] >> bit.astype(np.uint8)) & 1 > 0


def _smoothed(light: FloatArray, clipped: FloatArray) -> FloatArray:
    """Give a light a little wider, as high as it was."""
    there = (clipped > 0).astype(np.float32)
    near = scipy.ndimage.gaussian_filter(there, SMOOTHING_CELLS, mode="constant")
    wide = scipy.ndimage.gaussian_filter(light * there, SMOOTHING_CELLS, mode="constant")
    return np.divide(wide, near, out=np.zeros_like(wide), where=near > _TINY)


def _depth(lit: Mask, rows: Index, columns: Index) -> FloatArray:
    """Give the distance of pixels from what is not lit, at most `DEEPEST`; 0 outside."""
    beside, across = np.ones(rows.size, np.bool_), np.ones(rows.size, np.bool_)
    for dy, dx in ((0, 1), (1, 0), (1, 2), (2, 1)):
        beside &= lit[rows + dy, columns + dx]
    for dy, dx in ((0, 0), (0, 2), (2, 0), (2, 2)):
        across &= lit[rows + dy, columns + dx]
    inner = np.where(across, DEEPEST, np.sqrt(2))
    depth = np.where(beside, inner, 1) * lit[rows + 1, columns + 1]
    return np.asarray(depth, np.float32)


def _between(
    field: FloatArray, rows: Index, columns: Index, offset_px: tuple[float, float]
) -> FloatArray:
    """Give a field of cells at pixels, linear between the middles of cells."""
    upper, lower, share_y = _corners(rows, offset_px[0], field.shape[0])
    left, right, share_x = _corners(columns, offset_px[1], field.shape[1])
    above = field[upper, left] * (1 - share_x) + field[upper, right] * share_x
    below = field[lower, left] * (1 - share_x) + field[lower, right] * share_x
    return np.asarray(above * (1 - share_y) + below * share_y, np.float32)


def _corners(places: Index, offset_px: float, cells: int) -> tuple[Index, Index, FloatArray]:
    """Give the cells on both sides of pixels along one axis, and the share of the second."""
    at = (places - np.float32(offset_px)) / np.float32(PITCH_PX)
    low = np.floor(at)
    share = np.asarray(at - low, np.float32)
    first = low.astype(np.int32)
    return np.clip(first, 0, cells - 1), np.clip(first + 1, 0, cells - 1), share
