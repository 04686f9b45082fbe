"""The parameter of a blur by least error: fitted on one half of the blocks, judged on the other."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.sensor import RGB
from camkit.calibration.blur_pair.blur_errors import BlurErrors

FloatLine = NDArray[np.float64]

MOST_STEPS: Final = 24
"""To one side of the start, in which the least error is looked for."""
_HALVINGS: Final = 2
_NEAR: Final = 2
"""Points to each side of the best through which a parabola is fitted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchResult:
    """The parameter that explains a picture best.

    Attributes:
        best: By all blocks.
        halves: By the even blocks, and by the odd ones.
        colours: By each colour alone.
        errors: Of every block at what the other half found.
        start: Errors at the start of the search.
        is_bracketed: Whether the error rises to both sides of the best.
    """

    best: float
    halves: tuple[float, float]
    colours: tuple[float, ...]
    errors: BlurErrors
    start: BlurErrors
    is_bracketed: bool

    @property
    def error(self) -> float:
        """Return its uncertainty: by the halves, or by the colours if those differ more."""
        of_halves = abs(self.halves[0] - self.halves[1]) / 2
        of_colours = float(np.std(self.colours, ddof=1) / np.sqrt(len(self.colours)))
        return max(of_halves, of_colours)


def search(
    errors_at: Callable[[float], BlurErrors], start: float, step: float, is_even: NDArray[np.bool_]
) -> SearchResult:
    """Find the parameter of the least error from a start, downhill.

    Args:
        errors_at: Errors at a parameter.
        start: Where the search begins.
        step: First step; the last one is a quarter of it.
        is_even: (block,), which blocks are in the even half.
    """
    errors_of: dict[float, BlurErrors] = {}

    def total(value: float) -> float:
        if value not in errors_of:
            errors_of[value] = errors_at(value)
        return float(errors_of[value].sums.sum())

    best, is_bracketed = _descent(total, start, step)
    for _ in range(_HALVINGS):
        step /= 2
        best = min((best - step, best, best + step), key=total)
    points = np.array([best + step * i for i in range(-_NEAR, _NEAR + 1)])
    for point in points:
        total(float(point))
    table = np.stack([errors_of[float(point)].sums for point in points])
    # (3, block, zone, colour): a parabola of the error of each
    offsets = (points - best) / step
    bends = np.polyfit(offsets, table.reshape(len(points), -1), 2).reshape(3, *table.shape[1:])

    def least(part: FloatLine) -> float:
        bend, slope = part[0].sum(), part[1].sum()
        at = -slope / (2 * bend) if bend > 0 else -_NEAR * np.sign(slope)
        return float(np.clip(at, -_NEAR, _NEAR))

    even, odd = least(bends[:, is_even]), least(bends[:, ~is_even])
    at = np.where(is_even, odd, even)[:, None, None]
    sums = np.maximum(bends[0] * at**2 + bends[1] * at + bends[2], 0)
    colours = tuple(best + step * least(bends[..., c]) for c in range(len(RGB)))
    return SearchResult(
        best=best + step * least(bends),
        halves=(best + step * even, best + step * odd),
        colours=colours,
        errors=BlurErrors(sums=sums, counts=errors_of[best].counts),
        start=errors_of[start],
        is_bracketed=is_bracketed,
    )


def _descent(total: Callable[[float], float], start: float, step: float) -> tuple[float, bool]:
    """Walk downhill in steps; return where it ends, and whether the error rises beyond it."""
    way = step if total(start + step) < total(start - step) else -step
    place = start
    for _ in range(MOST_STEPS):
        if total(place + way) >= total(place):
            return place, True
        place += way
    return place, False
