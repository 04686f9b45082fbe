"""Straight edges of a target, found in a capture, and the profile of every colour across them.

    mosaic -> one plane of whole cells -> squares that show one straight step, and no more
      -> the line of the step, fitted -> samples of each colour by their distance from it

Nothing is demosaicked: each colour gives its own samples, at their own places. The edges may lie at
any angle.

References: ISO 12233 (the slanted edge).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.cfa import CfaPattern, cfa_channels
from camkit.runtime.capture import Capture

FloatLine = NDArray[np.float64]
FloatGrid = NDArray[np.float64]
Sites = NDArray[np.bool_]
Samples = tuple[FloatGrid, FloatGrid, FloatLine]
"""(y, x, value) of one colour, each (n,)."""

SQUARE_PX: Final = 128
STEP_PX: Final = 64
REACH_PX: Final = 44
"""To both sides of an edge, how far its profile is looked at."""
BINS_PER_PX: Final = 2
LEAST_STEP: Final = 0.05
"""Of white, from dark to bright."""
LEAST_RATIO: Final = 1.5
"""Bright over dark."""
LEAST_EXPLAINED: Final = 0.97
"""Share of the variance of a square that a straight step must explain."""
MOST_UNEVEN: Final = 0.15
"""Of the step, how much the bright and the dark side may rise or fall towards their ends."""
EXTREMES: Final = (0.025, 0.975)
"""Quantiles of a square between which its step is sought."""
_CELL_PX: Final = 2
_ROUNDS: Final = 6
_OUTER: Final = 0.6
_LEAST_SAMPLES: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profile:
    """One colour across an edge, in narrow bins.

    Attributes:
        distance_px: (bin,) mean distance of the samples from the edge, > 0 where it is bright.
        value: (bin,) their mean, linear.
        count: (bin,) how many they are, >= 1.
    """

    distance_px: FloatLine
    value: FloatLine
    count: FloatLine


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Edge:
    """A straight edge.

    Attributes:
        x_px: Of a point in the middle of it, in pixels of the capture.
        y_px: Likewise.
        normal: (y, x) of unit length, towards the bright side.
        profiles: One for each colour.
    """

    x_px: float
    y_px: float
    normal: tuple[float, float]
    profiles: tuple[Profile, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundEdges:
    """The edges of a capture.

    Attributes:
        edges: As they were found, row by row.
        clipped: Squares that show a step, and samples that are clipped.
    """

    edges: tuple[Edge, ...]
    clipped: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """The line of an edge in a picture: a point (y, x), and the unit normal to its bright side."""

    y: float
    x: float
    angle: float

    @property
    def normal(self) -> tuple[float, float]:
        """Return (y, x) of unit length."""
        return float(np.sin(self.angle)), float(np.cos(self.angle))

    def distances(self, y: FloatGrid, x: FloatGrid) -> FloatGrid:
        """Return the distances of pixels from the line, positive on its bright side."""
        down, right = self.normal
        return np.asarray((y - self.y) * down + (x - self.x) * right)

    def along(self, y: FloatGrid, x: FloatGrid) -> FloatGrid:
        """Return the positions of pixels along the line."""
        down, right = self.normal
        return np.asarray((y - self.y) * right - (x - self.x) * down)


def find_edges(capture: Capture) -> FoundEdges:
    """Find the straight edges of a capture.

    Args:
        capture: A mosaic, or planes. Of planes the middle one is searched.
    """
    linear = capture.linear_rows(0, capture.height)
    unusable: Sites = np.isnan(linear) | capture.saturated_rows(0, capture.height)
    if capture.cfa is None:
        unusable = np.max(unusable, axis=0)
    linear[..., unusable] = 0.0
    unusable_cells: Sites = np.max(_as_cells(unusable), axis=0)
    edges: list[Edge] = []
    clipped = 0
    for y_px, x_px, angle in _steps(searched_cells(linear, capture)):
        if any(math.hypot(y_px - edge.y_px, x_px - edge.x_px) < STEP_PX for edge in edges):
            continue
        top, left = (round(at - SQUARE_PX / 2) // _CELL_PX * _CELL_PX for at in (y_px, x_px))
        if unusable_cells[_square(top // _CELL_PX, left // _CELL_PX)].any():
            clipped += 1
            continue
        square = linear[..., top : top + SQUARE_PX, left : left + SQUARE_PX]
        if min(top, left) < 0 or square.shape[-2:] != (SQUARE_PX, SQUARE_PX):
            continue
        line = Line(y=y_px - top, x=x_px - left, angle=angle)
        edge = _edge(square, capture, (top, left), line)
        if edge is not None:
            edges.append(edge)
    return FoundEdges(edges=tuple(edges), clipped=clipped)


def _square(top: int, left: int) -> tuple[slice, slice]:
    """Return the place of a square among cells."""
    size = SQUARE_PX // _CELL_PX
    return slice(top, top + size), slice(left, left + size)


def _as_cells(pixels: NDArray[Any]) -> NDArray[Any]:
    """Return (4, h, w): the pixels of each cell of 2x2, row by row."""
    height, width = (side // _CELL_PX * _CELL_PX for side in pixels.shape)
    return np.stack([pixels[y:height:2, x:width:2] for y in (0, 1) for x in (0, 1)])


def searched_cells(linear: NDArray[np.float32], capture: Capture) -> FloatGrid:
    """Return one value for each cell: the mean of its green samples, or of the middle plane."""
    if capture.cfa is None:
        searched = _as_cells(linear[len(linear) // 2])
    else:
        searched = _as_cells(linear)[np.array(cfa_channels(capture.cfa)).ravel() == 1]
    return np.asarray(searched.mean(axis=0, dtype=np.float64))


def _steps(cells: FloatGrid) -> Iterator[tuple[float, float, float]]:
    """Yield (y, x) in pixels and angle of the steps of all squares.

    A square is looked at twice: where it lies, and with the step in its middle.
    """
    size, step = SQUARE_PX // _CELL_PX, STEP_PX // _CELL_PX
    for top in range(0, cells.shape[0] - size + 1, step):
        for left in range(0, cells.shape[1] - size + 1, step):
            first = _step_in(cells, top, left)
            if first is None:
                continue
            corner = [round((at - 0.5) / _CELL_PX - (size - 1) / 2) for at in first[:2]]
            if any(not 0 <= at <= n - size for at, n in zip(corner, cells.shape, strict=True)):
                continue
            second = _step_in(cells, *corner)
            if second is not None:
                yield second


def _step_in(cells: FloatGrid, top: int, left: int) -> tuple[float, float, float] | None:
    """Return (y, x) in pixels and the angle of the step of a square, None where there is none."""
    step = step_of(cells[_square(top, left)])
    if step is None:
        return None
    return step[0] + top * _CELL_PX, step[1] + left * _CELL_PX, step[2]


def step_of(cells: FloatGrid) -> tuple[float, float, float] | None:
    """Return (y, x) in pixels of a point of the one step of a picture, and the angle of its normal.

    All gradients of a straight edge point along its normal, so their sum does too.

    Args:
        cells: (h, w), one value for each cell of 2x2 pixels.

    Returns:
        None where there is no step.
    """
    low, high = np.quantile(cells[::2, ::2], EXTREMES)
    if high - low < LEAST_STEP or high < LEAST_RATIO * low:
        return None
    down, right = (np.diff(cells, axis=axis) for axis in (0, 1))
    gradient = np.stack([down[:, 1:] + down[:, :-1], right[1:] + right[:-1]]) / 2
    total = gradient.sum((1, 2))
    length = float(np.hypot(*total))
    if length < (high - low) * min(cells.shape) / 4:
        return None
    rise = np.tensordot(total / length, gradient, axes=1)
    y, x = np.mgrid[: rise.shape[0], : rise.shape[1]] + 0.5
    middle = (float((rise * at).sum() / rise.sum()) for at in (y, x))
    y_px, x_px = (at * _CELL_PX + 0.5 for at in middle)
    return y_px, x_px, float(np.arctan2(total[0], total[1]))


def _edge(
    square: NDArray[np.float32], capture: Capture, origin: tuple[int, int], line: Line
) -> Edge | None:
    """Fit the line of an edge and sort the samples of each colour; None where it is no edge."""
    samples = edge_samples(square, capture.cfa, origin)
    searched = samples[1] if len(samples) > 1 else samples[0]
    fitted = _fitted(line, searched)
    if fitted is None:
        return None
    profiles = [_profile(fitted.distances(y, x), values) for y, x, values in samples]
    if any(profile is None for profile in profiles):
        return None
    down, right = fitted.normal
    return Edge(
        x_px=origin[1] + fitted.x,
        y_px=origin[0] + fitted.y,
        normal=(down, right),
        profiles=tuple(profile for profile in profiles if profile is not None),
    )


def edge_samples(
    square: NDArray[np.floating], cfa: CfaPattern | None, origin: tuple[int, int] = (0, 0)
) -> list[Samples]:
    """Return (y, x, value) of the samples of each colour.

    Args:
        square: (h, w) of a mosaic, or (c, h, w).
        cfa: Letters of the mosaic.
        origin: (row, column) of the square in it.
    """
    y, x = np.mgrid[: square.shape[-2], : square.shape[-1]].astype(np.float64)
    if cfa is None:
        return [(y.ravel(), x.ravel(), plane.ravel().astype(np.float64)) for plane in square]
    colours = np.array(cfa_channels(cfa))
    sites = colours[(y.astype(int) + origin[0]) % 2, (x.astype(int) + origin[1]) % 2]
    return [
        (y[sites == c], x[sites == c], square[sites == c].astype(np.float64))
        for c in range(colours.max() + 1)
    ]


def _fitted(line: Line, samples: Samples) -> Line | None:
    """Fit a line until its profile explains the samples best; None if it never does."""
    fit = fit_line(line, samples, (SQUARE_PX, SQUARE_PX))
    if fit is None or fit[2] < LEAST_EXPLAINED or not is_even(fit[1]):
        return None
    return fit[0]


def fit_line(
    line: Line, samples: Samples, size: tuple[int, int], reach_px: float = REACH_PX
) -> tuple[Line, Profile, float] | None:
    """Fit place and angle of a line until its profile explains the samples near it best.

    A sample off the profile by r, where this rises by p' a pixel, lies r / p' nearer to the edge
    than the line says: least squares for the place and the angle of the line.

    Args:
        line: To begin with.
        samples: Of one colour.
        size: (h, w) of their picture.
        reach_px: To both sides of the line, how far samples count.

    Returns:
        The line, the profile, and the share of the variance that it explains; None where the line
        leaves the picture, or a side of it is not seen.
    """
    y, x, values = samples
    explained, profile = 0.0, None
    for _ in range(_ROUNDS):
        distance, position = line.distances(y, x), line.along(y, x)
        profile = _profile(distance, values, reach_px)
        if profile is None:
            return None
        near = np.abs(distance) < reach_px
        distance, position, light = distance[near], position[near], values[near]
        variance = float(light.var())
        is_outside = not (0 <= line.y <= size[0] and 0 <= line.x <= size[1])
        if is_outside or not variance > 0:
            return None
        slope = np.gradient(profile.value, profile.distance_px)
        rise = np.interp(distance, profile.distance_px, slope)
        rest = light - np.interp(distance, profile.distance_px, profile.value)
        explained = 1 - float(rest.var()) / variance
        table = np.stack([rise, rise * position], axis=1)
        (move, turn), *_ = np.linalg.lstsq(table, rest, rcond=None)
        down, right = line.normal
        line = Line(y=line.y - move * down, x=line.x - move * right, angle=line.angle + turn)
    return None if profile is None else (line, profile, explained)


def is_even(profile: Profile, reach_px: float = REACH_PX) -> bool:
    """Return whether both sides of a step are flat."""
    distance, value = profile.distance_px, profile.value
    ends = []
    for side in (-1, 1):
        outer = side * distance > _OUTER * reach_px
        mean, slope = value[outer].mean(), np.polyfit(distance[outer], value[outer], 1)[0]
        ends.append((mean, slope * (1 - _OUTER) * reach_px))
    step = ends[1][0] - ends[0][0]
    return bool(step > 0 and max(abs(rise) for _, rise in ends) < MOST_UNEVEN * step)


def _profile(distance: FloatLine, values: FloatLine, reach_px: float = REACH_PX) -> Profile | None:
    """Return the means of bins within the reach; None where a side of the edge is not seen."""
    count = math.ceil(2 * reach_px * BINS_PER_PX)
    number = np.floor((distance + reach_px) * BINS_PER_PX).astype(np.intp)
    near = (number >= 0) & (number < count)
    number = number[near]
    counts = np.bincount(number, minlength=count).astype(np.float64)
    filled = counts >= _LEAST_SAMPLES
    if filled.sum() < count / 4 or not (filled[: count // 4].any() and filled[-count // 4 :].any()):
        return None
    sums = (np.bincount(number, values_of[near], count)[filled] for values_of in (distance, values))
    places, means = (total / counts[filled] for total in sums)
    return Profile(distance_px=places, value=means, count=counts[filled])
