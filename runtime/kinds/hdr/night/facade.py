"""Buildings with lit windows, and windows seen from near."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.night.canvas import (
    Canvas,
    Patch,
    cover,
    disc,
    patch_around,
    rectangle,
    shine,
    textured,
)
from camkit.runtime.kinds.hdr.night.lamp import WHITES, add_shaded_lamp, draw_power, draw_white
from camkit.scenes.texture import Colour, Generator

MOST_WINDOW_POWER: Final = 20.0
_WHITES: Final = np.array(list(WHITES.values()), dtype=np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Building:
    """A front seen straight on; all in pixels of the canvas.

    Attributes:
        top: Its upper edge; may lie outside, as all edges may.
        bottom: Its lower edge.
        left: Its left edge.
        right: Its right edge.
        lit: Share of its windows that are lit.
    """

    top: float
    bottom: float
    left: float
    right: float
    lit: float


def draw_wall(rng: Generator) -> Colour:
    """Draw the (3,) reflectance of a wall: plaster, stone, brick."""
    value = np.exp(rng.uniform(np.log(0.08), np.log(0.6)))
    tint = np.array([1 + rng.uniform(0, 0.35), 1.0, 1 - rng.uniform(0, 0.35)])
    return np.asarray(np.clip(value * tint, 0, 0.9), dtype=np.float32)


def add_building(rng: Generator, canvas: Canvas, building: Building) -> None:
    """Draw a building: wall, floors, windows, an edge of the roof."""
    half_height = (building.bottom - building.top) / 2
    half_width = (building.right - building.left) / 2
    cy, cx = building.top + half_height, building.left + half_width
    patch = patch_around(canvas, cy, cx, half_height, half_width)
    if patch is None:
        return
    alpha = rectangle(patch, half_height, half_width)
    wall = textured(rng, canvas, patch, draw_wall(rng), rng.uniform(0.05, 0.25), kind=0)
    cell_height, cell_width = rng.uniform(9, 30), rng.uniform(7, 26)
    down = (patch.dy + np.float32(half_height)) / np.float32(cell_height)
    across = (patch.dx + np.float32(half_width)) / np.float32(cell_width)
    # a cornice at every floor
    wall *= 1 - np.float32(0.35) * (down % 1 < 1.2 / cell_height)
    cover(canvas, patch, alpha, np.minimum(wall, 1))
    opening = _openings(rng, (down, across), (cell_height, cell_width))
    radiance = _rooms(rng, down, across, building.lit)
    canvas.surface[patch.at] *= 1 - np.float32(0.8) * (opening * alpha)
    shone = radiance.max(axis=0) > 0
    shine(canvas, patch, opening * alpha * shone, radiance)


def _openings(
    rng: Generator, place: tuple[FloatArray, FloatArray], cell: tuple[float, float]
) -> FloatArray:
    """Return the coverage of windows, with a cross of bars in large ones."""
    (down, across), (cell_height, cell_width) = place, cell
    rows, columns = down % 1, across % 1
    tall, wide = rng.uniform(0.4, 0.75), rng.uniform(0.35, 0.8)
    ink = _soft_band(rows, tall, cell_height) * _soft_band(columns, wide, cell_width)
    if wide * cell_width > 7:
        bar = np.clip(np.abs(columns - 0.5) * cell_width - 0.2, 0, 1)
        ink = ink * (0.15 + 0.85 * bar)
    if tall * cell_height > 9:
        bar = np.clip(np.abs(rows - 0.4) * cell_height - 0.2, 0, 1)
        ink = ink * (0.15 + 0.85 * bar)
    # no window above the first and below the last floor
    whole = (down > 0.3) & (down < np.floor(float(down.max())))
    return np.asarray(ink * whole, dtype=np.float32)


def _soft_band(share: FloatArray, width: float, cell_px: float) -> FloatArray:
    inside = (width / 2 - np.abs(share - 0.5)) * cell_px
    return np.asarray(np.clip(inside + 0.5, 0, 1), dtype=np.float32)


def _rooms(rng: Generator, down: FloatArray, across: FloatArray, lit: float) -> FloatArray:
    """Return (3, a, b) radiance of the rooms behind a front, constant colour in each."""
    rows, columns = down.astype(np.intp)[:, 0], across.astype(np.intp)[0]
    floors, rooms = int(rows.max()) + 1, int(columns.max()) + 1
    # some floors are lit as a whole, most rooms are not
    share = np.clip(lit * np.exp(rng.normal(0, 0.7, (floors, 1))), 0, 0.95)
    lit_rooms = rng.random((floors, rooms)) < share
    power = np.exp(rng.normal(np.log(0.5), 1.3, (floors, rooms)))
    power = np.clip(power, 0.03, MOST_WINDOW_POWER) * lit_rooms
    usual = int(rng.integers(len(_WHITES)))
    other = rng.integers(len(_WHITES), size=(floors, rooms))
    kind = np.where(rng.random((floors, rooms)) < 0.7, usual, other)
    colour = (_WHITES[kind] * power[..., None]).astype(np.float32)
    # light comes from the ceiling; a curtain may hide one side
    depth = 1 - np.float32(rng.uniform(0.2, 0.7)) * (down % 1)
    curtain = rng.uniform(0.15, 1, (floors, rooms)).astype(np.float32)
    side = np.where(across % 1 < 0.5, curtain[rows[:, None], columns], np.float32(1))
    radiance = colour[rows[:, None], columns].transpose(2, 0, 1)
    return np.asarray(radiance * (depth * side), dtype=np.float32)


def add_near_window(
    rng: Generator, canvas: Canvas, cy: float, cx: float, half: tuple[float, float]
) -> None:
    """Draw a window seen from near: panes, a room with a lamp, curtains, a figure or a plant.

    Args:
        rng: Draws the room.
        canvas: Painted in place.
        cy: Row of its middle.
        cx: Its column.
        half: Half its height and half its width, in pixels.
    """
    patch = patch_around(canvas, cy, cx, half[0] + 3, half[1] + 3)
    if patch is None:
        return
    frame = np.full(3, rng.uniform(0.05, 0.7), dtype=np.float32)[:, None, None]
    cover(canvas, patch, rectangle(patch, half[0] + 2.5, half[1] + 2.5), frame)
    power = draw_power(rng, 1.0, MOST_WINDOW_POWER)
    room = textured(rng, canvas, patch, draw_white(rng) * power, rng.uniform(0.1, 0.4))
    room *= 1 - np.float32(0.35) * (patch.dy / np.float32(half[0]) + 1)
    panes = rectangle(patch, *half)
    if rng.random() < 0.5:
        room *= _curtains(rng, patch, half[1])
    np.clip(room, 0, MOST_WINDOW_POWER, out=room)
    shine(canvas, patch, panes, room)
    if min(half) > 14:
        _furnish(rng, canvas, cy, cx, half)
    bars = _bars(rng, patch, half)
    cover(canvas, patch, bars * panes, frame)


def _curtains(rng: Generator, patch: Patch, half_width: float) -> FloatArray:
    """Return the transmission of two curtains with folds."""
    open_share = rng.uniform(0.0, 0.8)
    folds = 0.5 + 0.25 * np.sin(patch.dx * np.float32(2 * np.pi / rng.uniform(4, 9)))
    curtain = np.abs(patch.dx) > np.float32(open_share * half_width)
    return np.where(curtain, folds * np.float32(rng.uniform(0.15, 0.6)), np.float32(1))


def _furnish(
    rng: Generator, canvas: Canvas, cy: float, cx: float, half: tuple[float, float]
) -> None:
    """Draw a lamp into a room, and a figure before its light."""
    if rng.random() < 0.6:
        x = cx + rng.uniform(-0.6, 0.6) * half[1]
        size = half[1] * rng.uniform(0.12, 0.25)
        radiance = draw_white(rng) * draw_power(rng, 8.0)
        add_shaded_lamp(rng, canvas, cy - rng.uniform(0.3, 0.6) * half[0], x, size, radiance)
    if rng.random() < 0.6:
        x, tall = cx + rng.uniform(-0.7, 0.7) * half[1], half[0] * rng.uniform(0.5, 1.2)
        dark = np.full((3, 1, 1), 0.06, dtype=np.float32)
        for y, radius in ((cy + half[0] - tall, tall * 0.18), (cy + half[0], tall * 0.55)):
            figure = patch_around(canvas, y, x, radius + 1)
            if figure is not None:
                inside = figure.dy + np.float32(y) <= cy + half[0] + 1
                cover(canvas, figure, disc(figure, radius) * inside, dark)


def _bars(rng: Generator, patch: Patch, half: tuple[float, float]) -> FloatArray:
    """Return the coverage of the bars between the panes."""
    thick = np.float32(max(0.6, min(half) * 0.045))
    bars = np.zeros((patch.dy.shape[0], patch.dx.shape[1]), dtype=np.float32)
    for offsets, length, most in ((patch.dy, half[0], 4), (patch.dx, half[1], 5)):
        panes = int(rng.integers(1, most))
        for index in range(1, panes):
            at = np.float32(length * (2 * index / panes - 1))
            np.maximum(bars, np.clip(thick + 0.5 - np.abs(offsets - at), 0, 1), out=bars)
    return bars
