"""The phase that a surface adds to light: a diffractive surface or a phase plate.

In order M a ray gains the path M w Phi(x, y) / 2 pi at the wavelength w, so that the bend grows
with the wavelength, as that of a grating does: 1 / f of phase_radial_rad is
-M w phase_radial_rad[0] / (pi phase_radius_mm^2).
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from camkit.errors import ContractError
from camkit.models_def.optics.tracing.phase_polynomial import PhaseForm
from camkit.models_def.toml_table import key_line
from camkit.units import to_mm

MOST_POWER: Final = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Monomial:
    """A term of a free phase: coefficient x^p y^q, x and y in normalisation radii."""

    p: int
    q: int
    coefficient_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A phase polynomial.

    Attributes:
        radius_mm: To which r, x and y are normalised.
        radial_rad: Coefficients of (r / radius)^2, (r / radius)^4, ...
        free_rad: Further terms in x and y.
        order: Of diffraction, M.
    """

    radius_mm: float
    radial_rad: tuple[float, ...] = ()
    free_rad: tuple[Monomial, ...] = ()
    order: float = 1.0

    def __post_init__(self) -> None:
        numbers = (*self.coefficients, self.order)
        if not all(map(math.isfinite, numbers)):
            raise ContractError(f"a phase needs finite numbers; got {numbers}")
        if not (math.isfinite(self.radius_mm) and self.radius_mm > 0):
            raise ContractError(f"phase_radius_mm must be > 0; got {self.radius_mm}")
        powers = [(m.p, m.q) for m in self.free_rad]
        if len(set(powers)) < len(powers):
            raise ContractError(f"a term of a phase stands twice: {powers}")

    @property
    def coefficients(self) -> tuple[float, ...]:
        """All of them, in radians: radial ones, then free ones."""
        return (*self.radial_rad, *(m.coefficient_rad for m in self.free_rad))

    def with_coefficients(self, values: Sequence[float]) -> "Phase":
        """Return the phase with the first `values` as its coefficients."""
        radial = len(self.radial_rad)
        free = zip(self.free_rad, values[radial:], strict=False)
        return replace(
            self,
            radial_rad=tuple(values[:radial]),
            free_rad=tuple(replace(m, coefficient_rad=value) for m, value in free),
        )

    @property
    def form(self) -> PhaseForm:
        """The static half of it."""
        return PhaseForm(
            radius_mm=self.radius_mm,
            radial=len(self.radial_rad),
            powers=tuple((m.p, m.q) for m in self.free_rad),
        )

    @property
    def is_round(self) -> bool:
        """True if it is the same at all azimuths, as far as its terms say."""
        return not any(m.coefficient_rad for m in self.free_rad)

    def turned(self, azimuth_rad: float) -> "Phase":
        """Return it seen with the direction at an azimuth (from +y towards +x) at +y."""
        cos, sin = math.cos(azimuth_rad), math.sin(azimuth_rad)
        sums: dict[tuple[int, int], float] = {}
        # x = cos x' + sin y', y = cos y' - sin x'
        for m in self.free_rad:
            for i in range(m.p + 1):
                for j in range(m.q + 1):
                    share = math.comb(m.p, i) * cos**i * sin ** (m.p - i)
                    share *= math.comb(m.q, j) * (-sin) ** j * cos ** (m.q - j)
                    powers = (i + j, m.p + m.q - i - j)
                    sums[powers] = sums.get(powers, 0.0) + share * m.coefficient_rad
        terms = (Monomial(p=p, q=q, coefficient_rad=a) for (p, q), a in sums.items())
        return replace(self, free_rad=tuple(terms))

    def order_mm(self, wavelength_um: float) -> float:
        """Return the path in mm per radian of phase."""
        return self.order * to_mm(wavelength_um) / (2 * math.pi)


def parse_monomials(terms: Mapping[str, float]) -> tuple[Monomial, ...]:
    """Read {"x3": 20.0, "x2y": -3.0} as terms in x and y.

    Raises:
        ContractError: If a name is none of x, y, x2, xy, x2y3, ...
    """
    return tuple(_monomial(name, value) for name, value in terms.items())


def monomial_name(term: Monomial) -> str:
    """Return the name of a term, such as x2y."""
    parts = [
        letter + (str(power) if power > 1 else "")
        for letter, power in (("x", term.p), ("y", term.q))
        if power
    ]
    return "".join(parts)


def _monomial(name: str, value: object) -> Monomial:
    match = re.fullmatch(r"(x(\d*))?(y(\d*))?", name)
    if not name or match is None:
        raise ContractError(f"a term of phase_free_rad is named x3, y, x2y, ...; got {name!r}")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ContractError(f"phase_free_rad.{name} must be a number; got {value!r}")
    p, q = (
        0 if part is None else int(digits or 1)
        for part, digits in ((match[1], match[2]), (match[3], match[4]))
    )
    if not 0 < p + q <= MOST_POWER:
        raise ContractError(f"a term of phase_free_rad has powers 1..{MOST_POWER}; got {name!r}")
    return Monomial(p=p, q=q, coefficient_rad=float(value))


def parse_phase(
    radial_rad: tuple[float, ...] | None,
    free_rad: Mapping[str, float] | None,
    *,
    radius_mm: float | None,
    order: float | None,
) -> Phase | None:
    """Return the phase that the keys of a surface state; None if they are missing.

    Raises:
        ContractError: If some are missing, or wrong.
    """
    if radial_rad is None and free_rad is None:
        if radius_mm is not None or order is not None:
            raise ContractError("a phase without phase_radial_rad or phase_free_rad")
        return None
    if radius_mm is None:
        raise ContractError("a phase needs phase_radius_mm, to which r, x and y are normalised")
    return Phase(
        radius_mm=radius_mm,
        radial_rad=radial_rad or (),
        free_rad=parse_monomials(free_rad or {}),
        order=1.0 if order is None else order,
    )


def phase_lines(phase: Phase) -> list[str]:
    """Return the lines of a prescription that state a phase."""
    lines = [f"phase_radius_mm = {phase.radius_mm!r}"]
    if phase.order != 1:
        lines.append(f"phase_order = {phase.order!r}")
    if phase.radial_rad:
        lines.append(key_line("phase_radial_rad", phase.radial_rad))
    if phase.free_rad:
        terms = ", ".join(f"{monomial_name(m)} = {m.coefficient_rad!r}" for m in phase.free_rad)
        lines.append(f"phase_free_rad = {{ {terms} }}")
    return lines
