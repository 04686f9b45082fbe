"""Lights of cells as lights of pixels: where samples clipped, shaped alike in all colours.

    cells and which of their samples clipped -> pixels of each colour that are lit
    lights of cells, smoothed, lower at rims  -> shape of every place, in each colour and in all
    colours that were seen beside those lit   -> bound them
    light of a place                          -> is shared out by the shape: none is lost or made

A mosaic samples red and blue at every fourth pixel. A pixel between them is lit if both sides
clipped, or if one did and its own sample, of another colour, clipped as well.

References: Sun 2021, chapter 5, gives pixels their light by a network; this stands before one.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS, PITCH_PX, Cells
from camkit.runtime.kinds.hdr.streaks.recovery import Recovery, Region
from camkit.runtime.kinds.hdr.streaks.regions import Window
from camkit.runtime.kinds.hdr.streaks.shapes import box_about

FULL_LEVEL: Final = 0.98
"""Of where samples clip: a pixel between samples that is darker did not, it was seen."""
SMOOTHING_CELLS: Final = 0.4
DEEPEST: Final = 2.0
"""A light rises from its rim to this many times as much."""
ALIKE: Final = 0.7
"""Share of a light whose shape is that of all colours together."""
COLOUR_SPAN: Final = 2.0
"""How many times as bright a colour may be beside one that was seen, against its whole place."""
DARK_CELLS: Final = 4
"""About what clipped, of which light is made: smoothing reaches 2, lit pixels lie beside, and are
linear between cells."""
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
        excess: (3, n): what their place exceeds white by, mean over its pixels.
    """

    rows: Index
    columns: Index
    light: FloatArray
    excess: FloatArray


def lit_pixels(recovery: Recovery) -> LitPixels:
    """Return the pixels of all lights."""
    none, dark = np.zeros(0, np.int32), np.zeros((COLOURS, 0), np.float32)
    parts = [LitPixels(rows=none, columns=none, light=dark, excess=dark)]
    parts += [_region_pixels(region, recovery.fine) for region in recovery.regions]
    rows = np.concatenate([part.rows for part in parts])
    order = np.argsort(rows, kind="stable")
    return LitPixels(
        rows=rows[order],
        columns=np.concatenate([part.columns for part in parts])[order],
        light=np.concatenate([part.light for part in parts], axis=1)[:, order],
        excess=np.concatenate([part.excess for part in parts], axis=1)[:, order],
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shaped:
    """Lit pixels of a window before their lights have their sums.

    Attributes:
        rows: (n,).
        columns: (n,).
        numbers: (n,) of their places.
        shapes: (3, n) of the lights; 0 where a colour is not lit.
        levels: (3, n): what samples say of the light, 1 at most.
    """

    rows: Index
    columns: Index
    numbers: Index
    shapes: FloatArray
    levels: FloatArray


def _region_pixels(region: Region, cells: Cells) -> LitPixels:
    region = _without_dark(region, cells)
    clipped = cells.clipped[(slice(None), *region.window.at)]
    places = _places(clipped, region.light)
    lit = _lit(places.numbers, cells, region)
    shaped = _shaped(places.numbers, lit, cells, region)
    light = _shared_out(shaped, places.light)
    return LitPixels(
        rows=shaped.rows + np.int32(PITCH_PX * region.window.top),
        columns=shaped.columns + np.int32(PITCH_PX * region.window.left),
        light=light,
        excess=_excess(light, shaped.numbers),
    )


def _without_dark(region: Region, cells: Cells) -> Region:
    """Return the part of a window in which pixels may be lit."""
    window = region.window
    clipped = np.asarray((cells.clipped[(slice(None), *window.at)] > 0).any(axis=0))
    if not clipped.any():
        return region
    rows, columns = box_about(clipped, DARK_CELLS)
    height, width = region.light[:, rows, columns].shape[1:]
    left, top = columns.start, rows.start
    place = Window(top=top, bottom=top + height, left=left, right=left + width)
    return replace(
        region,
        window=place.shifted(window.top, window.left),
        light=region.light[:, rows, columns],
        streaks=region.streaks[:, rows, columns],
    )


def _excess(light: FloatArray, numbers: Index) -> FloatArray:
    """Return the excess over white at the place of every pixel, mean over its pixels."""
    pixels = np.maximum(np.bincount(numbers), 1)
    excess = [np.bincount(numbers, np.maximum(plane - 1, 0)) / pixels for plane in light]
    return np.asarray(excess, np.float32)[:, numbers]


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
    """Return the lit pixels of a window in each colour: (3, h + 2, w + 2), a rim of False."""
    height, width = (PITCH_PX * side for side in numbers.shape)
    lit = np.zeros((COLOURS, height + 2, width + 2), np.bool_)
    at = (slice(None), *region.window.at)
    clipped, pixels = cells.clipped[at], cells.pixels[at]
    level = _level(cells, region)
    for rows, columns in _pixels_of(numbers):
        for colour in range(COLOURS):
            offset = cells.offset_px[colour]
            sample_clipped = _sample_clipped(pixels[min(colour, len(pixels) - 1)], rows, columns)
            full = _interpolated(level[colour], rows, columns, offset) >= FULL_LEVEL
            near = _interpolated(clipped[colour], rows, columns, offset) > 0
            lit[colour, rows + 1, columns + 1] = near & (sample_clipped | full)
    return lit


def _shaped(numbers: Index, lit: Mask, cells: Cells, region: Region) -> _Shaped:
    """Return the lit pixels of a window."""
    at = (slice(None), *region.window.at)
    clipped = cells.clipped[at]
    level = _level(cells, region)
    fields = [_smoothed(*planes) for planes in zip(region.light, clipped, strict=True)]
    none = np.zeros(0, np.int32)
    places = [(none, none, none)]
    values = [np.zeros((2, COLOURS, 0), np.float32)]
    for rows, columns in _pixels_of(numbers):
        some = lit[:, rows + 1, columns + 1].any(axis=0)
        y, x = rows[some], columns[some]
        block = np.empty((2, COLOURS, y.size), np.float32)
        for colour, field in enumerate(fields):
            offset = cells.offset_px[colour]
            block[0, colour] = _interpolated(field, y, x, offset) * _depth(lit[colour], y, x)
            block[1, colour] = _interpolated(level[colour], y, x, offset)
        places.append((y, x, numbers[y // PITCH_PX, x // PITCH_PX]))
        values.append(block)
    rows, columns, of_place = (np.concatenate(parts) for parts in zip(*places, strict=True))
    shapes, levels = np.concatenate(values, axis=2)
    return _Shaped(rows=rows, columns=columns, numbers=of_place, shapes=shapes, levels=levels)


def _level(cells: Cells, region: Region) -> FloatArray:
    """Return the level of all samples of the cells of a window: (3, h, w), 1 where they clipped."""
    at = (slice(None), *region.window.at)
    clipped = cells.clipped[at]
    return np.asarray(cells.light[at] * (1 - clipped) + clipped, np.float32)


def _shared_out(shaped: _Shaped, light: FloatArray) -> FloatArray:
    """Return lights (3, n) of these shapes whose sums in each place are as stated.

    Args:
        shaped: The pixels.
        light: (3, places + 1).
    """
    shapes, numbers = shaped.shapes, shaped.numbers
    lights = _all_summing_to(shapes, numbers, light)
    lights = _all_summing_to(np.minimum(lights, _most(shaped, light)), numbers, light)
    every, whole = lights.sum(axis=0), np.maximum(light.sum(axis=0), _TINY)
    alike = np.where(shapes > 0, every * (light / whole)[:, numbers], 0)
    mixed = (1 - ALIKE) * lights + ALIKE * _all_summing_to(alike, numbers, light)
    return np.asarray(np.where(shapes > 0, np.maximum(mixed, 1), 0), np.float32)


def _most(shaped: _Shaped, light: FloatArray) -> FloatArray:
    """Return the most that colours (3, n) may be beside one that was seen, in the place's colour.

    Where green clipped and red was seen to be dim, the light ends: its green is not bright either.
    """
    most = np.full(shaped.shapes.shape, np.inf, np.float32)
    for dim in range(COLOURS):
        dim_pixels = (shaped.shapes[dim] == 0) & (light[dim] > 0)[shaped.numbers]
        ratios = light / np.maximum(light[dim], _TINY)
        bound = COLOUR_SPAN * shaped.levels[dim] * ratios[:, shaped.numbers]
        most = np.where(dim_pixels, np.minimum(most, np.maximum(bound, 1)), most)
    return np.asarray(most, np.float32)


def _all_summing_to(shapes: FloatArray, numbers: Index, light: FloatArray) -> FloatArray:
    return np.stack([_summing_to(s, numbers, f) for s, f in zip(shapes, light, strict=True)])


def _summing_to(shape: FloatArray, numbers: Index, sums: FloatArray) -> FloatArray:
    there = np.bincount(numbers, shape, sums.size)
    factor = np.divide(sums, there, out=np.zeros(sums.size), where=there > _TINY)
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


def _sample_clipped(pixels: NDArray[np.uint8], rows: Index, columns: Index) -> Mask:
    """Return a mask of the pixels whose own sample clipped."""
    bit = (rows % PITCH_PX) * PITCH_PX + columns % PITCH_PX
    return (pixels[rows // PITCH_PX, columns // PITCH_PX] >> bit.astype(np.uint8)) & 1 > 0


def _smoothed(light: FloatArray, clipped: FloatArray) -> FloatArray:
    """Return a light a little wider, as high as it was."""
    there = (clipped > 0).astype(np.float32)
    near = scipy.ndimage.gaussian_filter(there, SMOOTHING_CELLS, mode="constant")
    wide = scipy.ndimage.gaussian_filter(light * there, SMOOTHING_CELLS, mode="constant")
    return np.divide(wide, near, out=np.zeros_like(wide), where=near > _TINY)


def _depth(lit: Mask, rows: Index, columns: Index) -> FloatArray:
    """Return the distance of pixels from what is not lit, at most `DEEPEST`; 0 outside."""
    sides, corners = np.ones(rows.size, np.bool_), np.ones(rows.size, np.bool_)
    for dy, dx in ((0, 1), (1, 0), (1, 2), (2, 1)):
        sides &= lit[rows + dy, columns + dx]
    for dy, dx in ((0, 0), (0, 2), (2, 0), (2, 2)):
        corners &= lit[rows + dy, columns + dx]
    inner = np.where(corners, DEEPEST, np.sqrt(2))
    depth = np.where(sides, inner, 1) * lit[rows + 1, columns + 1]
    return np.asarray(depth, np.float32)


def _interpolated(
    field: FloatArray, rows: Index, columns: Index, offset_px: tuple[float, float]
) -> FloatArray:
    """Return a field of cells at pixels, linear between the middles of cells."""
    upper, lower, share_y = _corners(rows, offset_px[0], field.shape[0])
    left, right, share_x = _corners(columns, offset_px[1], field.shape[1])
    above = field[upper, left] * (1 - share_x) + field[upper, right] * share_x
    below = field[lower, left] * (1 - share_x) + field[lower, right] * share_x
    return np.asarray(above * (1 - share_y) + below * share_y, np.float32)


def _corners(places: Index, offset_px: float, cells: int) -> tuple[Index, Index, FloatArray]:
    """Return the cells on both sides of pixels along one axis, and the share of the second."""
    at = (places - np.float32(offset_px)) / np.float32(PITCH_PX)
    low = np.floor(at)
    share = np.asarray(at - low, np.float32)
    first = low.astype(np.int32)
    return np.clip(first, 0, cells - 1), np.clip(first + 1, 0, cells - 1), share
