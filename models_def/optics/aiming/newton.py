"""Newton's method for the launch points of rays that are to pass wanted points of the stop."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.trace import Rays

AIM_STEPS: Final = 8
AIM_TOLERANCE: Final = 1e-10
DIFFERENCE: Final = 1e-7
USUAL_LENGTH_MM: Final = 100.0
_FLAT: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """The launch points of rays that pass wanted points of the stop.

    Attributes:
        x: Launch points in mm, see `start.launch`.
        y: The same.
        weight: Beam area per stop area; 0 where no launch point was found.
    """

    x: Tensor
    y: Tensor
    weight: Tensor


def flat_map(gain: float) -> bool:
    """Return whether rays of all launch points meet the stop at one point, to no use for Newton."""
    return not abs(gain) > _FLAT


def newton_aim(
    at_stop: Callable[[Tensor, Tensor], Rays],
    target: tuple[Tensor, Tensor],
    begin: tuple[Tensor, Tensor],
    *,
    steps: int = AIM_STEPS,
    fresh: int = AIM_STEPS,
    length_mm: float = USUAL_LENGTH_MM,
) -> Aim:
    """Find launch points by Newton's method with differences for slopes.

    Args:
        at_stop: Takes launch points x and y in mm to the rays on the stop, rims open.
        target: x and y in mm on the stop; broadcast with `begin`.
        begin: Launch points to begin from.
        steps: At most; the last one only judges. It ends sooner when every ray has arrived.
        fresh: So many first steps measure the slopes, at three traces each; the others keep them.
        length_mm: Of the lens: what differences and tolerances are shares of.
    """
    x, y = begin
    step, near2 = DIFFERENCE * length_mm, (AIM_TOLERANCE * length_mm) ** 2
    converged = torch.zeros_like(x, dtype=torch.bool)
    determinant = torch.ones_like(x)
    for number in range(steps):
        here = at_stop(x, y)
        if number < fresh:
            right, down = at_stop(x + step, y), at_stop(x, y + step)
            xx, yx = (right.x - here.x) / step, (right.y - here.y) / step
            xy, yy = (down.x - here.x) / step, (down.y - here.y) / step
        alive = here.valid & right.valid & down.valid
        product = xx * yy - xy * yx
        good = alive & (torch.abs(product) > _FLAT)
        determinant = torch.where(good, product, 1.0)
        ex, ey = target[0] - here.x, target[1] - here.y
        converged = good & (ex**2 + ey**2 < near2)
        if number == steps - 1 or bool(converged.all()):
            break
        # a dead probe ray steps back to the axis, from where it may try again
        x = torch.where(good, x + (yy * ex - xy * ey) / determinant, 0.5 * x)
        y = torch.where(good, y + (xx * ey - yx * ex) / determinant, 0.5 * y)
    return Aim(x=x, y=y, weight=torch.where(converged, 1 / torch.abs(determinant), 0.0))
