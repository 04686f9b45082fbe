"""Light of the lamps on the surfaces of a scene, as far as they reach, and no brighter than white.

Irradiance falls with the distance d from a lamp as (1 + d^2 / h^2)^(-3/2), that of a point at the
height h over a plane (inverse square and cosine law: Born and Wolf, Principles of Optics, ch. 4.8).
"""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.night.canvas import Canvas
from camkit.scenes.texture import Generator

CELL_PX: Final = 8
REACH_CELLS: Final = 80
BAND_ROWS: Final = 256
MOST_FACTOR: Final = 3.0
AMBIENT_TINT: Final = (0.80, 0.92, 1.15)
"""Of the light that comes from everywhere: the sky of a town."""


def shade(rng: Generator, canvas: Canvas, median: float) -> FloatArray:
    """Return the scene: surfaces in the light of the lamps, and the lamps.

    Args:
        rng: Draws how high the lamps hang and how much light comes from everywhere.
        canvas: Surfaces and lights; its light is used up.
        median: Of the light of its surfaces, where nothing shines.

    Returns:
        (3, h, w) float32.
    """
    height, width = canvas.size
    heights = np.exp(rng.uniform(np.log(3.0), np.log(9.0)))
    lit = _irradiance(_cells(canvas.light), float(heights))
    typical = float(np.percentile(lit, 97))
    lit *= np.float32(1 / typical if typical > 0 else 0)
    lit += np.float32(np.exp(rng.uniform(np.log(0.04), np.log(0.3)))) * _column(AMBIENT_TINT)
    factor = _factor(canvas, lit, median)
    for top in range(0, height, BAND_ROWS):
        rows = np.s_[:, top : min(top + BAND_ROWS, height)]
        surface = canvas.surface[rows] * _enlarged(lit, top, rows[1].stop, width)
        surface *= np.float32(factor)
        # a smooth knee below white: nothing that is lit is brighter than a lamp
        surface *= (1 + surface**2) ** np.float32(-0.5)
        canvas.light[rows] += surface
    return canvas.light


def _column(colour: tuple[float, float, float]) -> FloatArray:
    return np.array(colour, dtype=np.float32)[:, None, None]


def _cells(light: FloatArray) -> FloatArray:
    """Return the means over cells of `CELL_PX`, those at the end over what they hold."""
    _, height, width = light.shape
    rows, columns = (np.arange(0, side, CELL_PX) for side in (height, width))
    sums = np.add.reduceat(np.add.reduceat(light, rows, axis=1), columns, axis=2)
    tall, wide = np.diff(rows, append=height), np.diff(columns, append=width)
    return np.asarray(sums / (tall[:, None] * wide).astype(np.float32))


def _irradiance(cells: FloatArray, height_cells: float) -> FloatArray:
    """Convolve the light of the cells, by FFT; nothing wraps around."""
    at = np.arange(-REACH_CELLS, REACH_CELLS + 1, dtype=np.float64)
    square_distance = at[:, None] ** 2 + at**2
    kernel = (1 + square_distance / height_cells**2) ** -1.5
    full = tuple(side + 2 * REACH_CELLS for side in cells.shape[1:])
    spectrum = np.fft.rfft2(cells, full) * np.fft.rfft2(kernel, full)
    spread = np.fft.irfft2(spectrum, full)[:, REACH_CELLS:, REACH_CELLS:]
    return np.maximum(spread[:, : cells.shape[1], : cells.shape[2]], 0).astype(np.float32)


def _enlarged(cells: FloatArray, top: int, bottom: int, width: int) -> FloatArray:
    """Return rows top..bottom of the cells in pixels, by linear interpolation between middles."""
    first, second, share = _interpolation(np.arange(top, bottom), cells.shape[1])
    tall = cells[:, first] * (1 - share[:, None]) + cells[:, second] * share[:, None]
    first, second, share = _interpolation(np.arange(width), cells.shape[2])
    return np.asarray(tall[:, :, first] * (1 - share) + tall[:, :, second] * share)


def _interpolation(at_px: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    place = np.clip((at_px + 0.5) / CELL_PX - 0.5, 0, count - 1)
    first = place.astype(np.intp)
    share = (place - first).astype(np.float32)
    return first, np.minimum(first + 1, count - 1), share


def _factor(canvas: Canvas, lit: FloatArray, median: float) -> float:
    """Return the factor on all illumination that gives the surfaces their median.

    Where most of the picture is sky, surfaces stay darker.
    """
    middle = CELL_PX // 2
    rows, columns = (np.arange(n) * CELL_PX for n in lit.shape[1:])
    last_row, last_column = (side - 1 for side in canvas.size)
    rows, columns = np.minimum(rows + middle, last_row), np.minimum(columns + middle, last_column)
    place = np.ix_(np.arange(3), rows, columns)
    surface = (canvas.surface[place] * lit).mean(axis=0)
    lightless = surface[(canvas.light[place].max(axis=0) < median) & (surface > 0)]
    if not lightless.size:
        return 1.0
    goal = median * min(2 * lightless.size / surface.size, 1.0)
    return float(min(goal / np.median(lightless), MOST_FACTOR))
