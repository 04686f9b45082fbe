"""Entries of a lens at a focal length between those that were measured.

Terms of distortion fall about as one over the focal length, so their product with it is
interpolated, by a cubic through the two neighbours whose slopes are those of the chords to the next
ones (Catmull and Rom 1974); at the ends, of the chord between both. Vignetting is that of the
nearest entry, in lensfun's measure of distance: the focal length over the range of the lens, 4 over
the f-number, 0.1 m over the distance.

References: lensfun manual, "Coefficient interpolation" (lens.cpp).
"""

from collections.abc import Sequence
from typing import Final

from camkit.calibration.lensfun.database import Lens
from camkit.calibration.lensfun.models import Distortion, Vignetting
from camkit.errors import DecodeError

SAME: Final = 0.01
"""Of a focal length: so near to the end it counts as measured there."""


def distortion_at(lens: Lens, focal_mm: float) -> Distortion:
    """Return the distortion of a lens at a focal length.

    Raises:
        DecodeError: If the database has none of it, or it lies outside what was measured.
    """
    if not lens.distortion:
        raise DecodeError(f"{lens.file} has no distortion of {lens.name}")
    model = lens.distortion[0].model
    # as lensfun does: models cannot be mixed, and the first entry of a focal length counts
    by_focal: dict[float, Distortion] = {}
    for one in lens.distortion:
        if one.model == model:
            by_focal.setdefault(one.focal_mm, one)
    line = [by_focal[focal] for focal in sorted(by_focal)]
    low, high = line[0].focal_mm, line[-1].focal_mm
    if not low * (1 - SAME) <= focal_mm <= high * (1 + SAME):
        reach = f"{low:g} mm" if low == high else f"{low:g} to {high:g} mm"
        raise DecodeError(f"{lens.name} was measured at {reach}; got {focal_mm:g} mm")
    at = min(max(focal_mm, low), high)
    if at in by_focal:
        return by_focal[at]
    upper = next(index for index, one in enumerate(line) if one.focal_mm > at)
    terms = tuple(
        _cubic([one.terms[n] * one.focal_mm for one in line], _places(line, at), upper) / at
        for n in range(len(line[0].terms))
    )
    return Distortion(model=model, focal_mm=at, terms=terms)


def _places(line: Sequence[Distortion], at: float) -> float:
    """Return the interpolation weights between the neighbours of a focal length."""
    number = next(index for index, one in enumerate(line) if one.focal_mm > at)
    low, high = line[number - 1].focal_mm, line[number].focal_mm
    return (at - low) / (high - low)


def _cubic(values: Sequence[float], share: float, number: int) -> float:
    low, high = values[number - 1], values[number]
    chord = high - low
    start_slope = (high - values[number - 2]) / 2 if number >= 2 else chord
    end_slope = (values[number + 1] - low) / 2 if number + 1 < len(values) else chord
    # the cubic with these values and slopes, as what it adds to the straight line
    rest = 1 - share
    bend = (start_slope - chord) * rest - (end_slope - chord) * share
    return low + share * chord + share * rest * bend


def vignetting_at(
    lens: Lens, focal_mm: float, aperture: float | None, distance_m: float | None
) -> Vignetting | None:
    """Return the nearest entry of vignetting; None where the database has none.

    Args:
        lens: The lens.
        focal_mm: Focal length.
        aperture: F-number; None for the smallest opening that was measured.
        distance_m: None for the farthest.
    """
    if not lens.vignetting:
        return None
    focals = [one.focal_mm for one in lens.vignetting]
    span = max(max(focals) - min(focals), 1e-9)
    f_number = max(one.aperture for one in lens.vignetting) if aperture is None else aperture
    away_m = max(one.distance_m for one in lens.vignetting) if distance_m is None else distance_m

    def squared_distance(one: Vignetting) -> float:
        return (
            ((one.focal_mm - focal_mm) / span) ** 2
            + (4 / one.aperture - 4 / f_number) ** 2
            + (0.1 / one.distance_m - 0.1 / away_m) ** 2
        )

    return min(lens.vignetting, key=squared_distance)
