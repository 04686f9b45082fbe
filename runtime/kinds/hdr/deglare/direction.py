"""The one angle of the streaks of a picture, from what lies above and below its lights.

    overview -> sheared by an angle -> steps from column to column, each of bounded weight
             -> their sums above and below every light, fading with distance
             -> do both agree?

Both arms of a light have the same edges in the same columns if, and only if, the shear is theirs.
What a scene has above a light and below it agrees by chance alone; poles and walls that go on
through a light stand at the vertical, and no such angle is taken for a peak unless it lies within
the range that is looked at. A bounded weight (Geman and McClure 1987) keeps a few hard edges of the
scene from outvoting many faint steps that stand in line.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.deglare.overview import Overview
from camkit.runtime.kinds.hdr.deglare.slant import Slant

GRID_RAD: Final = math.radians(0.5)
MARGIN_RAD: Final = math.radians(1.5)
"""Angles beyond the range are looked at too: a peak must fall to both sides."""
FINE_RAD: Final = math.radians(0.2)
FINE_STEPS: Final = 3
"""To either side of the best angle of the grid."""
FADING: Final = 10.0
"""Overviews' heights per length over which the sums fade to 1/e."""
DARK: Final = 0.003
LEAST_AGREEMENT: Final = 0.4
LEAST_SIGNIFICANCE: Final = 6.0
LEAST_PROMINENCE: Final = 0.2
"""Share of its height by which a peak must rise above the ground on either side."""
MOST_MIRRORED: Final = 0.5
"""What stands upright leans as much to the left as to the right: share of a peak's height that may
be found at the mirrored angle."""
_LIGHT_SHARE: Final = 0.3
_TINY: Final = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """An angle and how sure it is.

    Attributes:
        angle_rad: From the vertical; > 0 where the streaks lean right going down.
        strength: What is maximised: summed products of the steps above and below the lights.
        agreement: Their correlation, -1..1.
        significance: The sum over its own spread, if every column were a draw of its own.
    """

    angle_rad: float
    strength: float
    agreement: float
    significance: float

    @property
    def is_sure(self) -> bool:
        """Return whether there are streaks."""
        return self.agreement >= LEAST_AGREEMENT and self.significance >= LEAST_SIGNIFICANCE


def find_direction(overview: Overview, least_rad: float, most_rad: float) -> Direction | None:
    """Find the angle at which streaks are surest.

    Args:
        overview: Of the picture.
        least_rad: Least angle from the vertical, to either side.
        most_rad: Largest.

    Returns:
        The direction; None where nothing is sure.
    """
    trial = _Trial(overview)
    left, right = (
        [trial.at(side * angle) for angle in _grid(least_rad, most_rad)] for side in (-1.0, 1.0)
    )
    peaks = [
        peak
        for peak in (*_peaks(left, right), *_peaks(right, left))
        if least_rad - GRID_RAD / 2 <= abs(peak.angle_rad) <= most_rad + GRID_RAD / 2
    ]
    best = max(peaks, key=lambda one: one.strength, default=None)
    return _refined(trial, best) if best is not None and best.is_sure else None


def _grid(least_rad: float, most_rad: float) -> list[float]:
    first, last = least_rad - MARGIN_RAD, most_rad + MARGIN_RAD
    count = math.ceil((last - first) / GRID_RAD) + 1
    return [first + GRID_RAD * number for number in range(count)]


def _peaks(directions: list[Direction], mirrored: list[Direction]) -> list[Direction]:
    """Return the part that rises above its neighbours, the ground on either side, its mirror."""
    strength = [one.strength for one in directions]
    peaks = []
    for here in range(1, len(directions) - 1):
        top = strength[here]
        ground = max(min(strength[:here]), min(strength[here + 1 :]))
        is_top = top >= max(strength[here - 1], strength[here + 1])
        is_high = top - ground >= LEAST_PROMINENCE * top > 0
        if is_top and is_high and mirrored[here].strength <= MOST_MIRRORED * top:
            peaks.append(directions[here])
    return peaks


def _refined(trial: "_Trial", start: Direction) -> Direction:
    """Return the top of the parabola that fits angles about the best one.

    Samples between columns lose a little of their steps: single angles ripple, their fit does not.
    """
    place = np.arange(-FINE_STEPS, FINE_STEPS + 1)
    strength = [trial.at(start.angle_rad + FINE_RAD * float(n)).strength for n in place]
    bend, slope, _ = np.polyfit(place, strength, 2)
    if bend >= 0:
        return start
    move = float(np.clip(-slope / (2 * bend), -FINE_STEPS, FINE_STEPS))
    return trial.at(start.angle_rad + FINE_RAD * move)


class _Trial:
    """An overview made ready to be sheared by many angles."""

    def __init__(self, overview: Overview) -> None:
        brightness = np.sqrt(np.maximum(overview.light, 0) + np.float32(DARK))
        near = scipy.ndimage.maximum_filter(overview.lights, size=(3, 5)) > 0
        self._planes = np.stack([brightness, near.astype(np.float32), overview.lights])
        steps = np.abs(np.diff(brightness, axis=1))
        self._scale = np.float32(max(2 * float(np.median(steps)) if steps.size else 0.0, 1e-3))
        self._fade = np.float32(math.exp(-FADING / brightness.shape[0]))

    def at(self, angle_rad: float) -> Direction:
        """Return the evidence for streaks of an angle."""
        _, height, width = self._planes.shape
        slant = Slant(angle_rad=angle_rad, height=height, width=width)
        (brightness, near, lights), share = slant.gathered(
            lambda top, bottom: self._planes[:, top:bottom], 3
        )
        good = (share > 0) & (near <= 0)
        step = np.zeros_like(brightness)
        step[:, 1:] = brightness[:, 1:] - brightness[:, :-1]
        step[:, 1:][~(good[:, 1:] & good[:, :-1])] = 0
        step /= np.sqrt(step * step + self._scale**2)
        above, below = _both_sides(step, lights > _LIGHT_SHARE, self._fade)
        product = above * below
        total = float(product.sum())
        size = math.sqrt(float((above**2).sum()) * float((below**2).sum()))
        spread = math.sqrt(float((product**2).sum()))
        return Direction(
            angle_rad=angle_rad,
            strength=total,
            agreement=total / (size + _TINY),
            significance=total / (spread + _TINY),
        )


def _both_sides(
    step: FloatArray, lights: NDArray[np.bool_], fade: np.float32
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the faded sums above and below every light, column by column."""
    wide = lights.copy()
    wide[:, 1:] |= lights[:, :-1]
    wide[:, :-1] |= lights[:, 1:]
    first, last = wide.copy(), wide.copy()
    first[1:] &= ~wide[:-1]
    last[:-1] &= ~wide[1:]
    above, below = _faded(step, fade), _faded(step[::-1], fade)[::-1]
    # the n-th first row of a column belongs to its n-th last one
    return above.T[first.T].astype(np.float64), below.T[last.T].astype(np.float64)


def _faded(step: FloatArray, fade: np.float32) -> FloatArray:
    """Return sums down to every row that fade with distance."""
    out = step.copy()
    for row in range(1, out.shape[0]):
        out[row] += fade * out[row - 1]
    return out
