"""Merits of spots as residuals of a least-squares problem.

Every merit gives two residuals a ray, along x and y about the centroid of a field, so that the sum
of their squares over all rays is the merit:

    rms       mean r^2: the usual one; a few far rays dominate it
    sum_abs   mean r^2 / sqrt(r^2 + s^2): halos cost less, cores more
    energy    mean s^2 (1 - exp(-r^2 / s^2)): the light outside a core of radius s
"""

from typing import Final, Literal, get_args

import torch
from torch import Tensor

from camkit.models_def.optics.search.beam_launch import LEAD
from camkit.models_def.optics.trace import Rays

Merit = Literal["rms", "sum_abs", "energy"]
MERITS: Final[tuple[Merit, ...]] = get_args(Merit)

_LOST_RAY: Final = 1.0


def spot_residuals(
    landings: Rays,
    core_mm: float,
    merit: Merit = "sum_abs",
    *,
    fields: int = 0,
    whole_pupil: bool = False,
) -> Tensor:
    """Return residuals (start, residual) in mm (sqrt(mm) for `sum_abs`).

    Args:
        landings: (start, field, wave, LEAD + ray) on the sensor, see `beam`; half the pupil,
            x >= 0, so that the centroid lies on x = 0.
        core_mm: s.
        merit: Which.
        fields: How many fields, from the axis, count; 0 for all. Of the others only lost rays do.
        whole_pupil: Whether both halves were traced, and the centroid may lie anywhere.
    """
    alive = landings.valid[..., LEAD:].to(landings.x.dtype)
    x, y = landings.x[..., LEAD:], landings.y[..., LEAD:]
    count = alive.sum((-2, -1), keepdim=True).clamp_min(1)
    dy = y - (y * alive).sum((-2, -1), keepdim=True) / count
    dx = x - (x * alive).sum((-2, -1), keepdim=True) / count if whole_pupil else x
    scale = _scale(dx**2 + dy**2, core_mm, merit) * alive
    counted = fields or scale.shape[1]
    scale = scale * (torch.arange(scale.shape[1]) < counted)[:, None, None]
    penalty = (1 - alive) * _LOST_RAY
    pairs = torch.stack([dx * scale + penalty, dy * scale], dim=-1)
    each = pairs[0, :counted].numel() // 2
    residuals: Tensor = pairs.flatten(1) / each**0.5
    return residuals


def _scale(square: Tensor, core_mm: float, merit: Merit) -> Tensor:
    """Return the factor from (x, y) to residuals; finite with its gradient at the centroid."""
    if merit == "rms":
        return torch.ones_like(square)
    if merit == "sum_abs":
        return (square + core_mm**2) ** -0.25
    share = square / core_mm**2
    # (1 - exp(-q)) / q, by its series near 0
    small = share < 1e-4
    safe = torch.where(small, 1.0, share)
    return torch.sqrt(torch.where(small, 1 - share / 2, -torch.expm1(-safe) / safe))
