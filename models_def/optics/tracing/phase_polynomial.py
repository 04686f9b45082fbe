"""A phase that a surface adds to light, as a polynomial in x and y, and rays bent by it.

The phase is Phi(x, y) in radians for one order; in order M light of the wavelength w gains the
path kappa Phi with kappa = M w / 2 pi. Rays then obey n' d' = n d + kappa grad Phi + (a multiple
of the normal N), the grating equation on a surface of any shape. With w = ratio d + (kappa / n')
grad Phi: d' = w + bend N, bend = (T - w.N) / N.N, T^2 = (w.N)^2 + N.N (1 - w.w).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.series import even_part


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseForm:
    """The static half of a phase polynomial.

    Attributes:
        radius_mm: R; terms are in r / R, x / R, y / R.
        radial: How many of the coefficients belong to (r / R)^2, (r / R)^4, ...
        powers: Of x / R and y / R, of each further coefficient.
    """

    radius_mm: float
    radial: int
    powers: tuple[tuple[int, int], ...] = ()


class PhaseValue(NamedTuple):
    """Phi in radians and its slopes by x and y in radians per mm."""

    value: Tensor
    x: Tensor
    y: Tensor


class PhaseTurn(NamedTuple):
    """The second derivatives of Phi in radians per mm^2."""

    xx: Tensor
    xy: Tensor
    yy: Tensor


def _power(base: Tensor, exponent: int) -> Tensor:
    return torch.ones_like(base) if exponent <= 0 else base**exponent


def _monomial(u: Tensor, v: Tensor, p: int, q: int, scale: float) -> PhaseValue:
    column, row = _power(u, p), _power(v, q)
    slope_x = _power(u, p - 1) * row * (p * scale)
    return PhaseValue(column * row, slope_x, column * _power(v, q - 1) * (q * scale))


def phase_value(form: PhaseForm, terms: Sequence[Tensor], x: Tensor, y: Tensor) -> PhaseValue:
    """Return the phase at points; x and y in mm."""
    scale = 1 / form.radius_mm
    rho = torch.addcmul(x * x, y, y)
    part = even_part(terms[: form.radial], rho, scale**2)
    value, slope_x, slope_y = part.height, part.lean * x, part.lean * y
    u, v = x * scale, y * scale
    for (p, q), a in zip(form.powers, terms[form.radial :], strict=False):
        one = _monomial(u, v, p, q, scale)
        value, slope_x, slope_y = value + a * one.value, slope_x + a * one.x, slope_y + a * one.y
    return PhaseValue(value, slope_x, slope_y)


def phase_turn(form: PhaseForm, terms: Sequence[Tensor], x: Tensor, y: Tensor) -> PhaseTurn:
    """Return the second derivatives at points."""
    scale = 1 / form.radius_mm
    rho = torch.addcmul(x * x, y, y)
    part = even_part(terms[: form.radial], rho, scale**2, twist=True)
    twice = torch.zeros_like(x) if part.twist is None else 2 * part.twist
    xx, xy, yy = part.lean + twice * x * x, twice * x * y, part.lean + twice * y * y
    u, v = x * scale, y * scale
    for (p, q), a in zip(form.powers, terms[form.radial :], strict=False):
        b = a * scale**2
        xx = xx + b * (p * (p - 1)) * _power(u, p - 2) * _power(v, q)
        xy = xy + b * (p * q) * _power(u, p - 1) * _power(v, q - 1)
        yy = yy + b * (q * (q - 1)) * _power(u, p) * _power(v, q - 2)
    return PhaseTurn(xx, xy, yy)


def phase_terms(form: PhaseForm, x: Tensor, y: Tensor) -> list[PhaseValue]:
    """Return the value and the slopes of each term with the coefficient 1."""
    scale = 1 / form.radius_mm
    t = torch.addcmul(x * x, y, y) * scale**2
    rows, power = [], torch.ones_like(t)
    for j in range(1, form.radial + 1):
        lean = power * (2 * j * scale**2)
        rows.append(PhaseValue(power * t, lean * x, lean * y))
        power = power * t
    rows += [_monomial(x * scale, y * scale, p, q, scale) for p, q in form.powers]
    return rows
