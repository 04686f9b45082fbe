"""Damped least squares (Levenberg-Marquardt) on a batch of starts with bounds.

Starts and difference columns are traced together, in one leading dimension.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.progress import counted

Residuals = Callable[[Tensor], Tensor]
"""(start, variable) in 0..1 to (start, residual)."""

_DIFFERENCE: Final = 1e-6
_DAMPING_RANGE: Final = (1e-6, 1e6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Descent:
    """The present state of the starts.

    Attributes:
        scaled: (start, variable), best first.
        merits: (start,), sums of squares.
        evaluations: Lenses traced in all, difference columns included.
    """

    scaled: Tensor
    merits: Tensor
    evaluations: int


def jacobian(residuals: Residuals, scaled: Tensor) -> tuple[Tensor, Tensor]:
    """Return residuals (start, residual) and forward differences (start, residual, variable)."""
    starts, count = scaled.shape
    # inwards, so that a lens at its upper bound is not asked for beyond it
    sign = torch.where(scaled > 0.5, -1.0, 1.0) * _DIFFERENCE
    both = torch.cat([scaled[:, None], scaled[:, None] + torch.diag_embed(sign)], dim=1)
    values = residuals(both.flatten(0, 1)).reshape(starts, count + 1, -1)
    slopes = (values[:, 1:] - values[:, :1]) / sign[..., None]
    return values[:, 0], slopes.transpose(1, 2)


def descend(residuals: Residuals, scaled: Tensor, steps: int, fixed: Tensor) -> Descent:
    """Lower the sum of squares of every start; no start ends worse than it began.

    Args:
        residuals: What is squared and summed.
        scaled: (start, variable) in 0..1.
        steps: Tried steps of each start.
        fixed: (variable,), numbers that stay.
    """
    damping = torch.full((len(scaled), 1), 1e-2, dtype=torch.float64)
    with torch.no_grad():
        for _ in counted(range(steps), "lowering the merit", "steps"):
            value, slope = jacobian(residuals, scaled)
            candidate = _step(value, slope, scaled, damping, fixed)
            better = (residuals(candidate) ** 2).sum(1) < (value**2).sum(1)
            scaled = torch.where(better[:, None], candidate, scaled)
            factor = torch.where(better, 0.3, 4.0)[:, None]
            damping = (damping * factor).clamp(*_DAMPING_RANGE)
        merits = (residuals(scaled) ** 2).sum(1)
    order = torch.argsort(merits)
    count = evaluations(len(scaled), steps, scaled.shape[1])
    return Descent(scaled=scaled[order], merits=merits[order], evaluations=count)


def evaluations(starts: int, steps: int, variables: int) -> int:
    """Return the number of lenses that `descend` traces."""
    return starts * (steps * (variables + 2) + 1)


def _step(value: Tensor, slope: Tensor, scaled: Tensor, damping: Tensor, fixed: Tensor) -> Tensor:
    normal = slope.transpose(1, 2) @ slope
    gradient = (slope.transpose(1, 2) @ value[..., None])[..., 0]
    # variables at a bound that would leave it, and held ones, stay
    stuck = ((scaled <= 0) & (gradient > 0)) | ((scaled >= 1) & (gradient < 0)) | fixed
    diagonal = normal.diagonal(dim1=1, dim2=2)
    weight = torch.where(stuck, 1e12, damping * diagonal + 1e-9)
    change = torch.linalg.solve(normal + torch.diag_embed(weight), -gradient)
    return torch.where(stuck, scaled, (scaled + change).clamp(0, 1))
