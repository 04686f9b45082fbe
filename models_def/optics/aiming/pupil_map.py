"""Launch points of many rays, foretold by those of a few.

Where a ray starts is a smooth function of where it passes the stop. So some hundred and fifty rays
of a beam are aimed, and a polynomial in the coordinates of the stop that is fitted to their launch
points foretells all others so well that Newton's method has one step left to do.
"""

from collections.abc import Callable
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.aiming.newton import Aim
from camkit.models_def.optics.trace import Rays

DEGREE: Final = 9
_TERMS: Final = (DEGREE + 1) * (DEGREE + 2) // 2
FEW: Final = 3 * _TERMS
MANY: Final = 6 * _TERMS
_EDGE: Final = 24
_CORRECTIONS: Final = 2
_RIDGE: Final = 1e-12


def few_rays(count: int) -> Tensor:
    """Return the numbers of the rays to aim, of samples that run from the middle to the edge."""
    spread = torch.linspace(0, count - 1, FEW).round().to(torch.int64)
    both = torch.cat([spread, torch.arange(count - _EDGE, count)])
    numbers: Tensor = torch.unique(both)
    return numbers


def foretold(
    at_stop: Callable[[Tensor, Tensor], Rays],
    target: tuple[Tensor, Tensor],
    few: Tensor,
    aimed: Aim,
) -> tuple[Tensor, Tensor]:
    """Return launch points x and y (..., ray) in mm of all rays of beams, corrected.

    Args:
        at_stop: Takes launch points (..., ray) in mm to the rays on the stop, rims open.
        target: x and y (ray,) in mm on the stop, the same for all beams.
        few: Numbers of the rays that are aimed already.
        aimed: Those, (..., few); weight 0 for what could not be.
    """
    radius_mm = torch.hypot(*target).amax()
    basis, along_x, along_y = _bases(target[0] / radius_mm, target[1] / radius_mm)
    is_known, rows = (aimed.weight > 0).to(torch.float64), basis[few]
    normal = torch.einsum("rt,...r,rs->...ts", rows, is_known, rows)
    normal = normal + _RIDGE * torch.eye(rows.shape[-1], dtype=torch.float64)
    right = torch.einsum(
        "rt,...r,...rc->...tc", rows, is_known, torch.stack([aimed.x, aimed.y], -1)
    )
    terms = torch.linalg.solve(normal, right)

    def values(polynomials: Tensor) -> tuple[Tensor, Tensor]:
        # one product of two matrices, many times as fast as one for each beam
        flat = polynomials @ terms.reshape(-1, *terms.shape[-2:]).transpose(0, 1).flatten(1)
        beams = flat.T.reshape(*terms.shape[:-2], 2, -1)
        return beams[..., 0, :], beams[..., 1, :]

    (x, y), (xx, yx), (xy, yy) = values(basis), values(along_x), values(along_y)
    for _ in range(_CORRECTIONS):
        here = at_stop(x, y)
        ex, ey = ((t - at) / radius_mm for t, at in zip(target, (here.x, here.y), strict=True))
        x = torch.where(here.valid, x + xx * ex + xy * ey, x)
        y = torch.where(here.valid, y + yx * ex + yy * ey, y)
    return x, y


def _bases(u: Tensor, v: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return polynomials (ray, term) that are orthonormal over the rays, and their slopes."""
    powers = [(total - j, j) for total in range(DEGREE + 1) for j in range(total + 1)]
    us = [u**i for i in range(DEGREE + 1)]
    vs = [v**i for i in range(DEGREE + 1)]
    zero = torch.zeros_like(u)
    plain = torch.stack([us[i] * vs[j] for i, j in powers], -1)
    by_u = torch.stack([i * us[i - 1] * vs[j] if i else zero for i, j in powers], -1)
    by_v = torch.stack([j * us[i] * vs[j - 1] if j else zero for i, j in powers], -1)
    basis, mix = torch.linalg.qr(plain)
    slopes = torch.linalg.solve_triangular(mix, torch.cat([by_u, by_v]), upper=True, left=False)
    by_u, by_v = slopes.chunk(2)
    return basis, by_u, by_v
