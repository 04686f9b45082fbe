"""MTF by slanted edge: of a capture, of a picture made of it, of any camera.

    picture with one edge -> direction and place from its gradients -> line through the centroids
    of the slope in every row -> profile, four times as fine as the pixels -> spectrum of its slope

A mosaic is measured as it is, on the sites of one colour. White noise, as large as it is beside the
edge, is taken out of the power of the spectrum: it raises no curve that lies above it. It is told
beside the MTF: by about so much a curve scatters, and what lies below it is not known.

References: ISO 12233 (the slanted edge); Burns 2000, "Slanted-edge MTF for digital camera and
scanner analysis".
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.report.edge_profile import (
    BINS_PER_PX,
    Bins,
    FloatLine,
    edge_waves,
    sort_samples,
)

FloatGrid = NDArray[np.float64]
Sites = NDArray[np.bool_]

CYCLES_PER_PX: Final[tuple[float, ...]] = tuple(np.linspace(0, 1, 41).tolist())
REACH_PX: Final = 24
LEAST_REACH_PX: Final = 6
LEAST_SIDE_PX: Final = 16
MOST_ANGLE_DEG: Final = 40.0
LEAST_CONTRAST: Final = 2.0
"""Step over the deviation of the samples from an ideal edge: below it there is no edge to see."""
FLAT_SHARE: Final = 0.25
"""Of the step, that may lie in the outer halves of the reach."""
_FIT_HALF_PX: Final = 8.0
_LEAST_ROWS: Final = 8
_ROUNDS: Final = 40
_SETTLED_PX: Final = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EdgeMtf:
    """The MTF across an edge.

    Attributes:
        cycles_per_px: (frequency,).
        mtf: (frequency,), 1 at frequency 0.
        noise: (frequency,), what the noise of the samples alone would give.
        angle_rad: Of the edge, from the axis of the picture that is nearest to it; > 0 where an
            edge along the columns moves to larger x with y, one along the rows to larger y with x.
        along_columns: Whether that axis is y: the MTF is that of the direction x.
    """

    cycles_per_px: FloatLine
    mtf: FloatLine
    noise: FloatLine
    angle_rad: float
    along_columns: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Line:
    """An edge along the columns, bright at its right: x = place + slope * y."""

    place: float
    slope: float

    def distances(self, shape: tuple[int, ...]) -> FloatGrid:
        y, x = np.mgrid[: shape[0], : shape[1]]
        return np.asarray((x - self.place - self.slope * y) / math.hypot(1, self.slope))


def edge_mtf(
    picture: NDArray[Any],
    *,
    cycles_per_px: Sequence[float] | NDArray[Any] = CYCLES_PER_PX,
    sites: Sites | None = None,
    bins_per_px: int = BINS_PER_PX,
    reach_px: int = REACH_PX,
) -> EdgeMtf:
    """Measure the MTF on one slanted edge.

    Args:
        picture: (h, w) linear, with one straight edge near the vertical or the horizontal.
        cycles_per_px: Frequencies, below `bins_per_px` / 2; those of a quarter of it are good to
            0.01 where samples see at least the area of a pixel.
        sites: (h, w), where the picture has samples, such as the green ones of a mosaic; None for
            everywhere.
        bins_per_px: How many times finer than the pixels the profile is. More for samples that
            are small beside their pitch.
        reach_px: How far from the edge it is looked at, each way, at most; a picture that shows
            less of it is looked at as far as it goes. Light that is spread wider is not seen.

    Raises:
        ContractError: If the picture is small, not finite, or shows no edge, a faint one, or one
            too near to an axis or to a diagonal.
    """
    values, there, frequencies = _checked(picture, sites, cycles_per_px, bins_per_px)
    normal, centre = _direction(values, there)
    along_columns = abs(normal[1]) >= abs(normal[0])
    if not along_columns:
        values, there, normal, centre = values.T, there.T, normal[::-1], centre[::-1]
    values = values * np.sign(normal[1])
    first_slope = -normal[0] / normal[1]
    first = _Line(place=centre[1] - first_slope * centre[0], slope=first_slope)
    _check_step(values, there, first)
    _check_angle(first)
    line = _fitted(values, there, first)
    _check_angle(line)
    distance = line.distances(values.shape)
    reach = _seen_reach(distance, there, reach_px)
    bins = sort_samples(distance, reach, bins_per_px=bins_per_px, sites=there)
    mtf, noise = _spectrum(values, bins, frequencies)
    return EdgeMtf(
        cycles_per_px=frequencies,
        mtf=mtf,
        noise=noise,
        angle_rad=math.atan(line.slope),
        along_columns=along_columns,
    )


def _checked(
    picture: NDArray[Any],
    sites: Sites | None,
    cycles_per_px: Sequence[float] | NDArray[Any],
    bins_per_px: int,
) -> tuple[FloatGrid, Sites, FloatLine]:
    values = np.asarray(picture, dtype=np.float64)
    if values.ndim != 2 or min(values.shape) < LEAST_SIDE_PX:
        raise ContractError(
            f"an edge needs a picture (h, w) of at least {LEAST_SIDE_PX} px a side; "
            f"got {list(values.shape)}"
        )
    there = np.ones(values.shape, bool) if sites is None else np.asarray(sites, bool)
    if there.shape != values.shape:
        raise ContractError(
            f"sites must be as large as the picture, {values.shape}; got {there.shape}"
        )
    if not np.isfinite(values[there]).all():
        raise ContractError(
            "the picture of an edge holds NaN or infinite samples; give finite ones"
        )
    frequencies = np.asarray(cycles_per_px, np.float64)
    if frequencies.ndim != 1 or not ((frequencies >= 0) & (frequencies < bins_per_px / 2)).all():
        raise ContractError(
            f"frequencies must be a list of cycles/pixel in [0, {bins_per_px / 2:g}) for "
            f"{bins_per_px} bins a pixel; give more bins for higher ones"
        )
    return np.where(there, values, 0.0), there, frequencies


def _direction(values: FloatGrid, there: Sites) -> tuple[FloatLine, FloatLine]:
    """Return the unit normal (y, x) towards the bright side, and a point (y, x) of the edge.

    All gradients of a straight edge point along its normal, so their sum does too.
    """
    if not there.all():
        weight = scipy.ndimage.uniform_filter(there.astype(np.float64), 3, mode="nearest")
        mean = scipy.ndimage.uniform_filter(values, 3, mode="nearest")
        values = mean / np.maximum(weight, 1e-9)
    down = np.diff(values, axis=0)
    right = np.diff(values, axis=1)
    gradient = np.stack([down[:, 1:] + down[:, :-1], right[1:] + right[:-1]]) / 2
    total = gradient.sum((1, 2))
    length = float(np.hypot(*total))
    if length <= 1e-12 * max(float(np.abs(values).max()) * values.size, 1e-300):
        raise ContractError("the picture shows no edge: it is as bright at its sides")
    normal = total / length
    slope = np.tensordot(normal, gradient, axes=1)
    y, x = np.mgrid[: slope.shape[0], : slope.shape[1]] + 0.5
    centre = np.array([(slope * y).sum(), (slope * x).sum()]) / length
    return normal, centre


def _check_step(values: FloatGrid, there: Sites, line: _Line) -> None:
    """Refuse what is no step from dark to bright."""
    bright = line.distances(values.shape) > 0
    sides = [values[there & side] for side in (~bright, bright)]
    if min(side.size for side in sides) == 0:
        raise ContractError("the picture shows no edge: none of it lies on one side")
    dark, light = sides
    step = float(light.mean() - dark.mean())
    deviation = math.sqrt(float(np.concatenate([dark - dark.mean(), light - light.mean()]).var()))
    if step < LEAST_CONTRAST * deviation:
        raise ContractError(
            f"the picture shows no edge, or too faint a one: its sides differ by {step:.3g}, its "
            f"samples deviate from them by {deviation:.3g}; give one straight edge, and more light"
        )


def _check_angle(line: _Line) -> None:
    angle_deg = abs(math.degrees(math.atan(line.slope)))
    if angle_deg > MOST_ANGLE_DEG:
        raise ContractError(
            f"the edge lies {angle_deg:.1f} degrees from the nearest axis; turn it to 2 to "
            f"{MOST_ANGLE_DEG:g} degrees"
        )


def _fitted(values: FloatGrid, there: Sites, line: _Line) -> _Line:
    """Fit the line through the centroids of the slope of every row, near where it was before."""
    half = min(_FIT_HALF_PX, values.shape[1] / 4)
    rows = [(y, np.flatnonzero(there[y])) for y in range(len(values))]
    slopes = [
        (y, (x[1:] + x[:-1]) / 2, np.diff(values[y, x])) for y, x in rows if x.size >= _LEAST_ROWS
    ]
    for _ in range(_ROUNDS):
        moments = []
        for y, place, slope in slopes:
            at = line.place + line.slope * y
            if not half <= at <= values.shape[1] - 1 - half:
                continue
            near = np.abs(place - at) < half
            weighted = slope[near] * np.cos(np.pi / 2 * (place[near] - at) / half) ** 2
            moments.append((y, weighted @ (place[near] - at), weighted.sum()))
        if len(moments) < _LEAST_ROWS:
            raise ContractError(
                f"the edge crosses {len(moments)} rows away from the border of the picture; "
                f"{_LEAST_ROWS} are needed: put it into the middle"
            )
        y, moment, step = np.array(moments).T
        if step.mean() <= 0:
            raise ContractError("the picture shows no straight edge: it is not steep along a line")
        change = np.polynomial.polynomial.polyfit(y, moment / step.mean(), 1)
        line = _Line(place=line.place + change[0], slope=line.slope + change[1])
        if np.abs(change[0] + change[1] * y).max() < _SETTLED_PX:
            break
    return line


def _seen_reach(distance: FloatGrid, there: Sites, most_px: int) -> int:
    """Return how far to both sides at least half as many samples are as beside the edge."""
    reach = most_px
    for side in (distance, -distance):
        counts = np.bincount(side[there & (side >= 0)].astype(np.intp), minlength=4)
        short = np.flatnonzero(counts < counts[:4].max() / 2)
        reach = min(reach, int(short[0]) if short.size else counts.size)
    if reach < LEAST_REACH_PX:
        raise ContractError(
            f"the picture shows {reach} px to one side of the edge; at least {LEAST_REACH_PX} are "
            "needed: put the edge into the middle"
        )
    return reach


def _spectrum(values: FloatGrid, bins: Bins, frequencies: FloatLine) -> tuple[FloatLine, FloatLine]:
    """Return MTF and noise."""
    profile = bins.means(values)
    _check_flat(profile, bins)
    waves = edge_waves(bins, np.append(frequencies, 0.0))
    power = np.abs(waves @ profile) ** 2
    noise = np.abs(waves) ** 2 @ (_variance(values, profile, bins) / bins.counts)
    scale = np.sqrt(power[-1])
    mtf = np.sqrt(np.maximum(power - noise, 0.0)[:-1]) / scale
    return mtf, np.sqrt(noise[:-1]) / scale


def _check_flat(profile: FloatLine, bins: Bins) -> None:
    quarter = bins.reach_px * bins.bins_per_px // 2
    width = bins.bins_per_px
    ends = profile[-width:].mean() - profile[:width].mean()
    middle = slice(quarter, -quarter)
    inner = profile[middle][-width:].mean() - profile[middle][:width].mean()
    if abs(ends - inner) > FLAT_SHARE * inner:
        raise ContractError(
            f"the edge is wider than the {bins.reach_px} px around it that are looked at, or the "
            "picture is not even beside it"
        )


def _variance(values: FloatGrid, profile: FloatLine, bins: Bins) -> float:
    """Return the variance of the samples away from the edge, around the profile."""
    residual = values[bins.inside] - profile[bins.number]
    middle = (bins.counts.size - 1) / 2
    outer = np.abs(bins.number - middle) > bins.counts.size / 4
    free = int(outer.sum()) - bins.counts.size // 2
    return float(np.square(residual[outer]).sum()) / max(free, 1)
