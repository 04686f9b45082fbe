"""The polynomial part of a surface in powers of r / R: odd, extended and Q aspheres.

With t = (r / R)^2 and u = r / R the part is P = a_1 t + a_2 t^2 + ... + b_1 u + b_2 u^3 + ...,
coefficients in mm, added to the conic; or P / S, S the root of the conic (Qbfs). A plain even
asphere does not come here: `profile` has it in powers of r^2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.profile import polynomial

LEAST_SHARE2: Final = 1e-12
"""Of t: nearer to the axis the slope of odd terms stays as it is there (a cone has an apex)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """The static half of a polynomial part.

    Attributes:
        radius_mm: R, to which r is normalised.
        odd: Whether it has odd terms.
        over_root: Whether it is divided by S.
    """

    radius_mm: float = 1.0
    odd: bool = False
    over_root: bool = False


class Part(NamedTuple):
    """A polynomial part at rho: height, q = 2 dh/d rho, and dq/d rho if asked for."""

    height: Tensor
    lean: Tensor
    twist: Tensor | None


def even_part(terms: Sequence[Tensor], rho: Tensor, scale2: float, *, twist: bool = False) -> Part:
    """Return a_1 t + a_2 t^2 + ... with t = rho * scale2, before any division."""
    t = rho * scale2
    if not terms:
        return Part(torch.zeros_like(t), torch.zeros_like(t), torch.zeros_like(t))
    lean = polynomial([a * (2 * j * scale2) for j, a in enumerate(terms, 1)], t)
    turns = [a * (2 * j * (j - 1) * scale2**2) for j, a in enumerate(terms, 1)][1:]
    second = None
    if twist:
        second = polynomial(turns, t) if turns else torch.zeros_like(t)
    return Part(t * polynomial(terms, t), lean, second)


def _odd_part(terms: Sequence[Tensor], rho: Tensor, scale2: float, *, twist: bool) -> Part:
    t = (rho * scale2).clamp_min(LEAST_SHARE2)
    u = torch.sqrt(t)
    powers = range(1, 2 * len(terms), 2)
    lean = polynomial([b * (p * scale2) for p, b in zip(powers, terms, strict=True)], t) / u
    second = None
    if twist:
        turns = [b * (p * (p - 2) / 2 * scale2**2) for p, b in zip(powers, terms, strict=True)]
        second = torch.where(t > LEAST_SHARE2, polynomial(turns, t) / (u * t), 0.0)
    return Part(u * polynomial(terms, t), lean, second)


def series_numerator(
    series: Series, even: Sequence[Tensor], odd: Sequence[Tensor], rho: Tensor, *, twist: bool
) -> Part:
    """Return P and its slopes, not divided by S."""
    scale2 = series.radius_mm**-2
    part = even_part(even, rho, scale2, twist=twist)
    if not series.odd:
        return part
    more = _odd_part(odd, rho, scale2, twist=twist)
    second = None if part.twist is None or more.twist is None else part.twist + more.twist
    return Part(part.height + more.height, part.lean + more.lean, second)


def series_part(
    series: Series,
    even: Sequence[Tensor],
    odd: Sequence[Tensor],
    conic: tuple[Tensor, Tensor],
    rho: Tensor,
    *,
    twist: bool = False,
) -> Part:
    """Return the polynomial part of a surface.

    Args:
        series: What is static.
        even: a_1, a_2, ... in mm.
        odd: b_1, b_2, ... in mm, of u, u^3, ...; not used without `series.odd`.
        conic: (1 + k) c^2, and 1 / S.
        rho: r^2 in mm^2.
        twist: Whether dq/d rho is computed.
    """
    part = series_numerator(series, even, odd, rho, twist=twist)
    if not series.over_root:
        return part
    # d(1/S)/d rho = opening / (2 S^3)
    opening, inverse = conic
    cube = opening * inverse**3
    lean = part.lean * inverse + part.height * cube
    second = part.twist
    if second is not None:
        second = second * inverse + part.lean * cube
        second = second + part.height * cube * (1.5 * opening) * inverse**2
    return Part(part.height * inverse, lean, second)


class TermSlopes(NamedTuple):
    """The height and the lean q of a surface by one number of it."""

    height: Tensor
    lean: Tensor


def term_slopes(
    series: Series, count: tuple[int, int], conic: tuple[Tensor, Tensor], rho: Tensor
) -> tuple[list[TermSlopes], list[TermSlopes]]:
    """Return the slopes by each even and by each odd coefficient.

    Args:
        series: What is static.
        count: Of even and of odd coefficients.
        conic: See `series_part`.
        rho: r^2 in mm^2.
    """
    scale2 = series.radius_mm**-2
    t = rho * scale2
    even, power = [], torch.ones_like(t)
    opening, inverse = conic
    for j in range(1, count[0] + 1):
        height, lean = power * t, power * (2 * j * scale2)
        if series.over_root:
            lean = lean * inverse + height * opening * inverse**3
            height = height * inverse
        even.append(TermSlopes(height, lean))
        power = power * t
    odd = []
    if series.odd:
        t = t.clamp_min(LEAST_SHARE2)
        power = torch.sqrt(t)
        for p in range(1, 2 * count[1], 2):
            odd.append(TermSlopes(power, power / t * (p * scale2)))
            power = power * t
    return even, odd


def opening_slopes(
    series: Series, even: Sequence[Tensor], conic: tuple[Tensor, Tensor], rho: Tensor
) -> TermSlopes:
    """Return the slopes of a part that is divided by S, by (1 + k) c^2; see `series_part`."""
    opening, inverse = conic
    part, cube = series_numerator(series, even, (), rho, twist=False), inverse**3
    height = part.height * rho / 2 * cube
    lean = part.lean * rho / 2 * cube + part.height * cube
    return TermSlopes(height, lean + part.height * 1.5 * opening * rho * cube * inverse**2)
