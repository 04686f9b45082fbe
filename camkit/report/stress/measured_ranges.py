"""Ranges that the runtime may rely on: of what it sees of a capture, from the sound values.

A scenario bounds some quantities of `camkit.runtime.envelope`. Over its sound values, from the
nominal outwards, the quantity took a range. Where the scenario broke beyond an end, that end holds
for all scenarios; an end beyond which none broke is the farthest that was tested.

To be sound here is to help: to beat the methods without networks, without a fault. chi^2 is left
to the report: where a clipped light leaves glare unexplained, the Wiener bank, to which a capture
outside the ranges falls back, explains it no better.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.manifest import Range
from camkit.report.stress.break_point import CHI2, sound_values
from camkit.report.stress.curve import Curve, margins
from camkit.runtime.envelope import OPEN_HIGH, OPEN_LOW


@dataclass(frozen=True, slots=True, kw_only=True)
class SoundRange:
    """Values of one quantity in one scenario.

    Attributes:
        low: Least value at which the method was sound.
        high: Largest.
        low_broken: Whether it broke below.
        high_broken: Whether it broke above.
    """

    low: float
    high: float
    low_broken: bool
    high_broken: bool


def measured_ranges(curves: Iterable[Curve], method: str) -> dict[str, Range]:
    """Return the envelope of a method.

    Args:
        curves: Of the scenarios that were swept; those that bound nothing are passed over.
        method: The one whose soundness counts.

    Returns:
        Quantity -> range. A quantity that broke at its nominal value is left out: there is no
        range in which the method helps, and every capture would be outside. So is all of a camera
        that offers nothing simpler: no help was shown where there was nothing to beat.
    """
    by_quantity: dict[str, list[tuple[str, SoundRange]]] = {}
    for curve in curves:
        if method not in curve.methods or not curve.rivals:
            continue
        for quantity, end in curve.scenario.bounds.items():
            sound_range = _sound_range(curve, quantity, method)
            if sound_range is not None:
                by_quantity.setdefault(quantity, []).append((end, sound_range))
    ranges = {}
    for quantity, entries in by_quantity.items():
        lows = [s for end, s in entries if end in ("low", "both")]
        highs = [s for end, s in entries if end in ("high", "both")]
        low, high = _low(lows), _high(highs)
        if low <= high:
            ranges[quantity] = Range(low=low, high=high)
    return ranges


def _sound_range(curve: Curve, quantity: str, method: str) -> SoundRange | None:
    """Return what a curve says of a quantity; None without a sound value."""
    if quantity not in curve.quantities:
        return None
    grid = curve.quantities[quantity]
    sound, broken = _helps(curve, method)
    finite = np.isfinite(grid)
    if not (sound[:, None] & finite).any():
        return None
    inside = grid[sound][finite[sound]]
    low, high = float(inside.min()), float(inside.max())
    outside = [float(grid[i][finite[i]].mean()) for i in np.flatnonzero(broken) if finite[i].any()]
    middle = float(grid[curve.nominal][finite[curve.nominal]].mean())
    return SoundRange(
        low=low,
        high=high,
        low_broken=any(value < middle for value in outside),
        high_broken=any(value > middle for value in outside),
    )


def _helps(curve: Curve, method: str) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return for each value whether the method was shown to help, and whether it was shown not to.

    Where nothing could be compared, all being clipped say, neither was shown.
    """
    margin = margins(curve, method)
    gains = {rule: gain for rule, gain in margin.gains.items() if rule != CHI2}
    sound = sound_values(replace(margin, gains=gains))
    compared = np.isfinite(curve.psnr_db[method]).any(axis=1)
    faulty = margin.faults.any(axis=1)
    return sound & compared, ~sound & (compared | faulty)


def _low(entries: Sequence[SoundRange]) -> float:
    """Join the lower ends: where one broke, the highest of those; else the least tested."""
    broken = [entry.low for entry in entries if entry.low_broken]
    if broken:
        return max(broken)
    return min((entry.low for entry in entries), default=OPEN_LOW)


def _high(entries: Sequence[SoundRange]) -> float:
    """Join the upper ends: where one broke, the least of those; else the largest tested."""
    broken = [entry.high for entry in entries if entry.high_broken]
    if broken:
        return min(broken)
    return max((entry.high for entry in entries), default=OPEN_HIGH)
