"""Skew rays through both faces of a plate whose grooves are infinitely shallow.

Every ray is bent at a plane, by the slope of the profile there: what `trace` does with ideal
grooves, without their steps, so that spots follow smoothly from the numbers of the profiles. The
planes lie half a groove into the plate, where the steps are on average; the way to the sensor is
counted from the rear one, so a sensor at that distance from the rear face itself stands half a
groove too far out (docs/guides/thin-plate.md, "How it is solved").
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.profile import TINY, polynomial


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateNumbers:
    """Plates before a sensor; all broadcast against (plate, direction, ray).

    Attributes:
        front: Terms of r^2, r^4, ... of the front profile.
        back: The same of the back profile.
        bfl_mm: From the back face to the sensor.
    """

    front: Sequence[Tensor]
    back: Sequence[Tensor]
    bfl_mm: Tensor


def trace_plate(
    plate: PlateNumbers, index: float, gap_mm: float, start: tuple[Tensor, Tensor], slope: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the landing points of rays of a distant scene.

    Args:
        plate: The plates.
        index: Of their glass.
        gap_mm: Between the planes of refraction.
        start: x and y in mm on the front face.
        slope: tan of the field angle.
    """
    x, y = start
    n = torch.rsqrt(1 + slope**2)
    l, m = torch.zeros_like(x), n * slope  # noqa: E741
    for terms, ratio, way_mm in (
        (plate.front, 1 / index, gap_mm),
        (plate.back, index, plate.bfl_mm),
    ):
        l, m, n = _bent(terms, ratio, (x, y), (l, m, n))  # noqa: E741
        way = way_mm / n
        x, y = x + way * l, y + way * m
    return x, y


def _bent(
    terms: Sequence[Tensor],
    ratio: float,
    place: tuple[Tensor, Tensor],
    direction: tuple[Tensor, Tensor, Tensor],
) -> tuple[Tensor, Tensor, Tensor]:
    """Refract by the normal (-q x, -q y, 1), q = 2 dh/d rho (Snell)."""
    (x, y), (l, m, n) = place, direction  # noqa: E741
    rho = x * x + y * y
    lean = polynomial([2 * j * a for j, a in enumerate(terms, start=1)], rho)
    length2 = 1 + lean * lean * rho
    facing = n - (x * l + y * m) * lean
    square = length2 * (1 - ratio**2) + facing**2 * ratio**2
    bend = (torch.sqrt(square.clamp_min(TINY)) - facing * ratio) / length2
    turn = bend * lean
    return ratio * l - turn * x, ratio * m - turn * y, ratio * n + bend
