"""Straight, isolated steps in a photograph, and the samples of each colour across them.

    mosaic -> one plane of whole cells -> gradients that agree along a line -> the strongest of
      every part of the field -> line of each, fitted -> samples of each colour by their distance

Nothing is demosaicked. An edge counts if its profile alone explains the strip around it and both
of its sides are flat.

References: Bigun 1987 (the structure tensor); ISO 12233 (the slanted edge).
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.edges import (
    MOST_UNEVEN,
    FloatLine,
    Line,
    Profile,
    Samples,
    edge_samples,
    fit_line,
    is_even,
    searched_cells,
)
from camkit.runtime.capture import Capture

CELL_PX: Final = 2
LEAST_STEP: Final = 0.04
"""Of white, from dark to bright, in the colour that is searched."""
LEAST_COLOUR_STEP: Final = 0.02
LEAST_RATIO: Final = 1.3
LEAST_EXPLAINED: Final = 0.95
"""Share of the variance of a strip that a straight step must explain."""
LIKELY: Final = 0.8
"""The same, before the line is fitted, of places that are worth it."""
LEAST_COHERENCE: Final = 0.8
MOST_OVERSHOOT: Final = 0.12
"""Of the step, by which the profile may leave the levels of its sides."""
ZONES: Final = 8
"""Rings of the field, each of which has its share of what is looked at."""
BINS_PER_PX: Final = 2
STRIP_PX: Final = 6
"""Of the pieces of an edge that belong to its one half and its other in turn."""
_SEARCH_CELLS: Final = 1.0
_MOST_TURN: Final = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldAxes:
    """The optical axis in a photograph.

    Attributes:
        axis_px: (x, y) of the axis, in pixels of the photograph.
        pitch_um: Of the pixels.
        radius_mm: From the axis to the farthest corner of the sensor.
    """

    axis_px: tuple[float, float]
    pitch_um: float
    radius_mm: float

    def to_mm(self, x_px: float, y_px: float) -> tuple[float, float]:
        """Return the position from the axis, right and down."""
        scale = self.pitch_um / 1000
        return (x_px - self.axis_px[0]) * scale, (y_px - self.axis_px[1]) * scale


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ColourRows:
    """One colour across an edge, as bins of its two halves.

    Attributes:
        distance_px: (n,) mean distance of the samples of a bin, > 0 where it is bright.
        value: (n,) their mean, linear.
        count: (n,) how many they are.
        half: (n,) 0 or 1.
        scatter: Standard deviation of one sample beside the edge, noise and texture.
    """

    distance_px: FloatLine
    value: FloatLine
    count: FloatLine
    half: NDArray[np.intp]
    scatter: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhotoEdge:
    """A straight step in a photograph.

    Attributes:
        photo: Number of the photograph.
        place_mm: (x, y) of its middle from the axis.
        outward: Component of its unit normal, which points to the bright side, away from the axis.
        sideways: The other component, without its sign.
        colours: Its samples; None for a colour that sees no step.
    """

    photo: int
    place_mm: tuple[float, float]
    outward: float
    sideways: float
    colours: tuple[ColourRows | None, ...]

    @property
    def height_mm(self) -> float:
        """Return the distance from the axis."""
        return math.hypot(*self.place_mm)


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeSearch:
    """The edges of a photograph.

    Attributes:
        edges: As they were found.
        places: Places that were looked at.
        clipped: Of those, where a sample is clipped.
    """

    edges: tuple[PhotoEdge, ...]
    places: int
    clipped: int


def find_photo_edges(
    capture: Capture, axes: FieldAxes, *, photo: int, reach_px: float, most: int
) -> EdgeSearch:
    """Find the isolated straight steps of a photograph.

    Args:
        capture: A mosaic, or planes. Green is searched, or the middle plane.
        axes: Where the axis lies in it.
        photo: Its number.
        reach_px: To both sides of an edge, how far nothing else may be.
        most: Places to look at.
    """
    linear = capture.linear_rows(0, capture.height)
    unusable = np.isnan(linear) | capture.saturated_rows(0, capture.height)
    linear[np.isnan(linear)] = 0.0
    if capture.cfa is None:
        unusable = np.max(unusable, axis=0)
    cells = searched_cells(linear, capture).astype(np.float32)
    length_px = edge_length_px(reach_px)
    steps = _steps(cells, axes, length_px, most)
    edges: list[PhotoEdge] = []
    middles: list[tuple[float, float, float]] = []
    clipped = 0
    box = math.ceil((math.hypot(reach_px, length_px / 2) + 3) / CELL_PX) * CELL_PX
    for y_px, x_px, angle in steps:
        top, left = (round(at) // CELL_PX * CELL_PX - box for at in (y_px, x_px))
        rows, columns = slice(top, top + 2 * box), slice(left, left + 2 * box)
        if min(top, left) < 0 or rows.stop > capture.height or columns.stop > capture.width:
            continue
        if not _is_likely(cells, (top, left), box, (angle, reach_px, length_px)):
            continue
        line = Line(y=y_px - top, x=x_px - left, angle=angle)
        if unusable[rows, columns][_strip(line, 2 * box, reach_px, length_px)].any():
            clipped += 1
            continue
        samples = edge_samples(linear[..., rows, columns], capture.cfa, (top, left))
        fitted = _fitted(line, samples, 2 * box, reach_px, length_px)
        if fitted is None:
            continue
        middle = fitted.y + top, fitted.x + left, fitted.angle
        if any(_is_same(middle, other, length_px) for other in middles):
            continue
        colours = tuple(_rows(fitted, one, reach_px, length_px) for one in samples)
        if colours[len(colours) // 2] is None:
            continue
        middles.append(middle)
        edges.append(_photo_edge(middle, colours, axes, photo))
    return EdgeSearch(edges=tuple(edges), places=len(steps), clipped=clipped)


def edge_length_px(reach_px: float) -> float:
    """Return the length of the edges that are sought."""
    return max(18.0, 1.6 * reach_px)


def _steps(
    cells: NDArray[np.float32], axes: FieldAxes, length_px: float, most: int
) -> list[tuple[float, float, float]]:
    """Return (y, x) in pixels and angle of the normal of places where gradients agree."""
    from scipy import ndimage

    smooth = ndimage.gaussian_filter(cells, _SEARCH_CELLS)
    down, right = np.gradient(smooth)
    width = length_px / 8 / CELL_PX * 2
    yy, xx, xy = (
        ndimage.gaussian_filter(product, width)
        for product in (down * down, right * right, down * right)
    )
    spread = np.hypot(xx - yy, 2 * xy)
    coherence = spread / np.maximum(xx + yy, 1e-12)
    score = np.sqrt(xx + yy) * np.where(coherence > LEAST_COHERENCE, coherence**2, 0)
    block = max(2, round(length_px / 2 / CELL_PX))
    rows, columns = (side // block for side in score.shape)
    if min(rows, columns) == 0:
        return []
    blocks = score[: rows * block, : columns * block].reshape(rows, block, columns, block)
    blocks = blocks.transpose(0, 2, 1, 3).reshape(rows * columns, -1)
    best = blocks.argmax(axis=1)
    values = blocks[np.arange(len(best)), best]
    y = np.arange(len(best)) // columns * block + best // block
    x = np.arange(len(best)) % columns * block + best % block
    best_places = _spread_over_field(values, y * CELL_PX + 0.5, x * CELL_PX + 0.5, axes, most)
    steps = []
    for i in best_places:
        at = int(y[i]), int(x[i])
        angle = 0.5 * math.atan2(2 * float(xy[at]), float(xx[at] - yy[at]))
        slope = float(np.asarray(down)[at]), float(np.asarray(right)[at])
        rise = math.sin(angle) * slope[0] + math.cos(angle) * slope[1]
        angle += 0 if rise > 0 else math.pi
        steps.append((at[0] * CELL_PX + 0.5, at[1] * CELL_PX + 0.5, angle))
    return steps


def _spread_over_field(
    values: FloatLine, y: FloatLine, x: FloatLine, axes: FieldAxes, most: int
) -> list[int]:
    """Return the numbers of the best places, as many of each ring of the field."""
    height = np.hypot(x - axes.axis_px[0], y - axes.axis_px[1]) * axes.pitch_um / 1000
    zone = np.minimum(height / axes.radius_mm * ZONES, ZONES - 1).astype(int)
    order = np.argsort(-values, kind="stable")
    order = order[values[order] > 0]
    zones = [order[zone[order] == n] for n in range(ZONES)]
    share = most // max(sum(one.size > 0 for one in zones), 1)
    return [int(i) for one in zones for i in one[:share]]


def _strip(line: Line, side: int, reach_px: float, length_px: float) -> NDArray[np.bool_]:
    y, x = np.mgrid[:side, :side].astype(np.float64)
    near = np.abs(line.distances(y, x)) < reach_px
    return np.asarray(near & (np.abs(line.along(y, x)) < length_px / 2))


def _fitted(
    line: Line, samples: list[Samples], side: int, reach_px: float, length_px: float
) -> Line | None:
    """Return the line of an isolated step; None if it is none."""
    y, x, values = samples[len(samples) // 2]
    inner = np.abs(line.along(y, x)) < length_px / 2
    fit = fit_line(line, (y[inner], x[inner], values[inner]), (side, side), reach_px)
    if fit is None or fit[2] < LEAST_EXPLAINED or not is_even(fit[1], reach_px):
        return None
    shift_px = math.hypot(fit[0].y - line.y, fit[0].x - line.x)
    if shift_px > reach_px / 2 or abs(fit[0].angle - line.angle) > _MOST_TURN:
        return None
    return fit[0] if _is_step(fit[1], reach_px) else None


def _is_likely(
    cells: NDArray[np.float32],
    corner: tuple[int, int],
    box: int,
    strip: tuple[float, float, float],
) -> bool:
    """Return whether a strip of cells may be a step, before its line is fitted.

    Args:
        cells: (h, w) of the photograph.
        corner: (row, column) of a square around the strip, in pixels.
        box: Half its side, in pixels.
        strip: Angle of the normal, reach and length in pixels.
    """
    angle, reach_px, length_px = strip
    top, left = (at // CELL_PX for at in corner)
    side = 2 * box // CELL_PX
    values = cells[top : top + side, left : left + side]
    offset = (np.arange(side) + 0.5) * CELL_PX - box
    down, right = math.sin(angle), math.cos(angle)
    distance = offset[:, None] * down + offset * right
    position = offset[:, None] * right - offset * down
    near = (np.abs(distance) < reach_px) & (np.abs(position) < length_px / 2)
    number = ((distance[near] + reach_px) / CELL_PX).astype(np.intp)
    strip_values = values[near].astype(np.float64)
    count = np.maximum(np.bincount(number), 1)
    means = np.bincount(number, strip_values) / count
    rest = strip_values - means[number]
    if rest.var() > (1 - LIKELY) * strip_values.var():
        return False
    outer = max(2, round(0.4 * reach_px / CELL_PX))
    dark, bright = means[:outer], means[-outer:]
    step = float(bright.mean() - dark.mean())
    uneven = max(
        abs(side[: outer // 2].mean() - side[-(outer // 2) :].mean()) for side in (dark, bright)
    )
    return bool(step > LIKELY * LEAST_STEP and uneven < 2 * MOST_UNEVEN * step)


def _is_step(profile: Profile, reach_px: float) -> bool:
    """Return whether a profile rises from one level to another, and does not leave them."""
    outer = 0.6 * reach_px
    dark = float(profile.value[profile.distance_px < -outer].mean())
    bright = float(profile.value[profile.distance_px > outer].mean())
    step = bright - dark
    if step < LEAST_STEP or bright < LEAST_RATIO * dark:
        return False
    most = MOST_OVERSHOOT * step
    return bool(profile.value.max() < bright + most and profile.value.min() > dark - most)


def _is_same(
    one: tuple[float, float, float], other: tuple[float, float, float], length_px: float
) -> bool:
    return math.hypot(one[0] - other[0], one[1] - other[1]) < 0.6 * length_px


def _rows(line: Line, samples: Samples, reach_px: float, length_px: float) -> ColourRows | None:
    """Return the bins of a colour; None where it sees no step."""
    y, x, values = samples
    distance, position = line.distances(y, x), line.along(y, x)
    inner = (np.abs(distance) < reach_px) & (np.abs(position) < length_px / 2)
    distance, position, values = distance[inner], position[inner], values[inner]
    half = (np.floor(position / STRIP_PX).astype(np.intp)) % 2
    bins = math.ceil(2 * reach_px * BINS_PER_PX)
    number = np.minimum(((distance + reach_px) * BINS_PER_PX).astype(np.intp), bins - 1)
    number = number + bins * half
    count = np.bincount(number, minlength=2 * bins).astype(np.float64)
    filled = count > 0
    means = [
        np.bincount(number, part, 2 * bins)[filled] / count[filled] for part in (distance, values)
    ]
    outer = 0.6 * reach_px
    sides = [values[side * distance > outer] for side in (-1, 1)]
    if min(side.size for side in sides) < BINS_PER_PX:
        return None
    step = float(sides[1].mean() - sides[0].mean())
    scatter = float(np.sqrt((sides[0].var() + sides[1].var()) / 2))
    if step < LEAST_COLOUR_STEP or step < 2 * scatter:
        return None
    return ColourRows(
        distance_px=means[0],
        value=means[1],
        count=count[filled],
        half=(np.arange(2 * bins) // bins)[filled],
        scatter=scatter,
    )


def _photo_edge(
    middle: tuple[float, float, float],
    colours: tuple[ColourRows | None, ...],
    axes: FieldAxes,
    photo: int,
) -> PhotoEdge:
    y_px, x_px, angle = middle
    x_mm, y_mm = axes.to_mm(x_px, y_px)
    height = max(math.hypot(x_mm, y_mm), 1e-9)
    normal_x, normal_y = math.cos(angle), math.sin(angle)
    return PhotoEdge(
        photo=photo,
        place_mm=(x_mm, y_mm),
        outward=(normal_x * x_mm + normal_y * y_mm) / height,
        sideways=abs(normal_x * y_mm - normal_y * x_mm) / height,
        colours=colours,
    )
