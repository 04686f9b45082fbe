"""What was found in cells, laid over pixels: lights put in, their streaks taken out.

    veil and streaks of cells -> rows of pixels, linear between the middles of cells
    lights of cells           -> spots: domes over the pixels of every clipped place

A cell at the rim of a light holds pixels that did not clip: those keep what the sensor saw.
Every pixel follows from the cells and its own place alone: bands of any height have the same bits.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.streaks.cells import COLOURS, Cells
from camkit.streaks.recovery import Recovery, Region
from camkit.streaks.shapes import dome, rim_distance_px, with_means

SEEN: Final = 0.98
"""Of where samples clip: a pixel of a rim that is darker did not, it was seen."""
_EIGHT: Final = np.ones((3, 3), np.int8)
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """The lights of one clipped place in one colour.

    Attributes:
        colour: Of the picture.
        top: First row of pixels.
        left: First column.
        light: (h, w) float32; 1.0 = where samples clip.
        mask: (h, w): pixels of cells in which a sample clipped.
        certain: (h, w): those away from its rim, which clipped whatever a demosaic made of them.
    """

    colour: int
    top: int
    left: int
    light: FloatArray
    mask: Mask
    certain: Mask


def spots_of(recovery: Recovery) -> tuple[Spot, ...]:
    """Give the spots of all regions, by their first row."""
    found = [
        spot
        for region in recovery.regions
        for colour in range(COLOURS)
        for spot in _region_spots(region, colour, recovery.fine)
    ]
    return tuple(sorted(found, key=lambda s: (s.top, s.left, s.colour)))


def _region_spots(region: Region, colour: int, cells: Cells) -> Iterator[Spot]:
    share = cells.clipped[(colour, *region.window.at)]
    labels, _ = scipy.ndimage.label(share > 0, structure=_EIGHT)
    offset = cells.offset_px[colour]
    # a cell stands for two rows of pixels: its own and the next, or, about a sample, the last
    shift_y, shift_x = (-1 if side < 0.5 else 0 for side in offset)
    for number, (rows, columns) in enumerate(scipy.ndimage.find_objects(labels), start=1):
        top, left = max(rows.start - 1, 0), max(columns.start - 1, 0)
        part = (slice(top, rows.stop + 1), slice(left, columns.stop + 1))
        mine = labels[part] == number
        full = mine & (share[part] == 1)
        yield Spot(
            colour=colour,
            top=2 * (region.window.top + top) + shift_y,
            left=2 * (region.window.left + left) + shift_x,
            light=_domed(mine, region.light[(colour, *part)], full),
            mask=_doubled(mine),
            certain=_doubled(scipy.ndimage.binary_erosion(full, _EIGHT, border_value=1)),
        )


def _domed(mask: Mask, means: FloatArray, full: Mask) -> FloatArray:
    """Give the light of pixels; no less than the sensor saw where all of a cell clipped."""
    light = with_means(
        dome(rim_distance_px(_doubled(mask), 1.0)), np.where(mask, means, 0).astype(np.float32)
    )
    return np.maximum(light, _doubled(full))


def _doubled(mask: Mask) -> Mask:
    return mask.repeat(2, axis=0).repeat(2, axis=1)


class Painter:
    """Lays a recovery over the rows of a picture."""

    def __init__(self, recovery: Recovery) -> None:
        self._recovery = recovery
        self._spots = spots_of(recovery)

    def paint(self, planes: FloatArray, top: int, gains: tuple[float, ...]) -> None:
        """Change rows of a picture in place.

        Args:
            planes: (3, rows, w) float32, full colour, multiplied by the gains.
            top: Number of the first row.
            gains: Of the colours.
        """
        found = self._recovery
        rows, width = planes.shape[1:]
        lights = list(self._lights(planes, top, gains))
        for colour, gain in enumerate(gains):
            under = _rows_of_cells(
                found.veil[colour],
                found.coarse.pitch_px,
                found.coarse.offset_px[colour],
                top,
                rows,
                width,
            )
            self._add_streaks(under, colour, top)
            under *= np.float32(gain)
            planes[colour] -= under
            planes[colour] *= np.float32(1 / found.core[colour])
        for target, light, where in lights:
            np.copyto(target, light, where=where)

    def _add_streaks(self, under: FloatArray, colour: int, top: int) -> None:
        cells = self._recovery.fine
        offset = cells.offset_px[colour]
        for region in self._recovery.regions:
            window = region.window
            first = max(2 * window.top - 1 - top, 0)
            last = min(2 * window.bottom + 1 - top, under.shape[0])
            if first >= last or not region.streaks[colour].any():
                continue
            left, right = max(2 * window.left - 1, 0), min(2 * window.right + 1, under.shape[1])
            moved = (offset[0] + 2 * window.top, offset[1] + 2 * window.left - left)
            under[first:last, left:right] += _rows_of_cells(
                region.streaks[colour], 2, moved, top + first, last - first, right - left
            )

    def _lights(
        self, planes: FloatArray, top: int, gains: tuple[float, ...]
    ) -> Iterator[tuple[FloatArray, FloatArray, Mask]]:
        """Yield views of the rows, the lights to put there, and the pixels that they are for."""
        rows, width = planes.shape[1:]
        for spot in self._spots:
            height, breadth = spot.light.shape
            first, last = max(spot.top, top), min(spot.top + height, top + rows)
            left, right = max(spot.left, 0), min(spot.left + breadth, width)
            if first >= last or left >= right:
                continue
            part = (
                slice(first - spot.top, last - spot.top),
                slice(left - spot.left, right - spot.left),
            )
            gain = np.float32(gains[spot.colour])
            target = planes[spot.colour, first - top : last - top, left:right]
            where = spot.mask[part] & (spot.certain[part] | (target >= SEEN * gain))
            yield target, spot.light[part] * gain, where


def _rows_of_cells(
    field: FloatArray,
    pitch_px: int,
    offset_px: tuple[float, float],
    top: int,
    rows: int,
    width: int,
) -> FloatArray:
    """Give rows of pixels (rows, width), linear between the middles of cells, even beyond them."""
    place = (np.arange(top, top + rows) - offset_px[0]) / pitch_px
    low = np.clip(np.floor(place).astype(int), 0, field.shape[0] - 1)
    high = np.minimum(low + 1, field.shape[0] - 1)
    share = np.clip(place - low, 0, 1).astype(np.float32)[:, None]
    lines = field[low] * (1 - share) + field[high] * share
    return _columns_of_cells(lines, pitch_px, offset_px[1], width)


def _columns_of_cells(lines: FloatArray, pitch_px: int, offset_px: float, width: int) -> FloatArray:
    """Give columns of pixels: those of one phase lie between their cells alike."""
    out = np.empty((lines.shape[0], width), np.float32)
    for phase in range(pitch_px):
        columns = out[:, phase::pitch_px]
        place = (phase - offset_px) / pitch_px
        first = int(np.floor(place))
        share = np.float32(place - first)
        index = first + np.arange(columns.shape[1])
        low = np.clip(index, 0, lines.shape[1] - 1)
        high = np.clip(index + 1, 0, lines.shape[1] - 1)
        columns[...] = lines[:, low] * (1 - share) + lines[:, high] * share
    return out
