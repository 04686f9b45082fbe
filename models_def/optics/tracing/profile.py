"""The profile of a surface: its height and slope over rho = r^2, from one square root.

h = c rho / (1 + S) + a_1 rho + a_2 rho^2 + ..., S^2 = 1 - (1 + k) c^2 rho (Sun 2021, eq. (2.2),
plus the r^2 term), and q = 2 dh/d rho = c / S + 2 a_1 + 4 a_2 rho + ... (eq. (2.3) in the form
that has no division by rho). (-q x, -q y, 1) is the normal.
"""

from collections.abc import Sequence
from typing import Final

from torch import Tensor

TINY: Final = 1e-12


def polynomial(coefficients: Sequence[Tensor], rho: Tensor) -> Tensor:
    """Return a_0 + a_1 rho + a_2 rho^2 + ... (Horner)."""
    total = coefficients[-1]
    for a in reversed(coefficients[:-1]):
        total = total * rho + a
    return total


def profile(
    c: Tensor, root: Tensor, terms: Sequence[Tensor], slopes: Sequence[Tensor], rho: Tensor
) -> tuple[Tensor, Tensor]:
    """Return height h in mm and q = 2 dh/d rho in 1/mm.

    Args:
        c: Curvature.
        root: S.
        terms: a_1, a_2, ...; may be empty.
        slopes: 2 a_1, 4 a_2, ...
        rho: r^2 in mm^2.
    """
    height, slope = c * rho / (1 + root), c / root
    if not terms:
        return height, slope
    return height + rho * polynomial(terms, rho), slope + polynomial(slopes, rho)
