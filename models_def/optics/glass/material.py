"""One optical material: its dispersion formula, coefficients and valid wavelengths."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, get_args

from camkit.errors import ContractError

Formula = Literal[
    "constant",
    "sellmeier",
    "sellmeier_offset",
    "sellmeier_mixed",
    "handbook_1",
    "handbook_2",
    "schott",
    "powers",
    "cauchy",
    "conrady",
    "herzberger",
    "buchdahl",
]
FORMULAS: Final[tuple[Formula, ...]] = get_args(Formula)

_COUNT_FITS: Final[Mapping[Formula, Callable[[int], bool]]] = {
    "constant": lambda count: count == 1,
    "sellmeier": lambda count: count > 0 and count % 2 == 0,
    "sellmeier_offset": lambda count: count % 2 == 1,
    "sellmeier_mixed": lambda count: count == 5,
    "handbook_1": lambda count: count == 4,
    "handbook_2": lambda count: count == 4,
    "schott": lambda count: count == 6,
    "powers": lambda count: count > 0 and count % 2 == 0,
    "cauchy": lambda count: count > 0,
    "conrady": lambda count: count == 3,
    "herzberger": lambda count: count == 6,
    "buchdahl": lambda count: count == 4,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Glass:
    """One optical material, relative to air.

    With w the wavelength in um, the coefficients are those of

    - constant: n = a;
    - sellmeier: B1, C1, B2, C2, ... of n^2 = 1 + sum B w^2 / (w^2 - C);
    - sellmeier_offset: A, B1, C1, ... of n^2 = A + sum B w^2 / (w^2 - C);
    - sellmeier_mixed: n^2 = 1 + A + B w^2 / (w^2 - C^2) + D / (w^2 - E^2);
    - handbook_1: n^2 = A + B / (w^2 - C) - D w^2;
    - handbook_2: n^2 = A + B w^2 / (w^2 - C) - D w^2;
    - schott: n^2 = A0 + A1 w^2 + A2 w^-2 + A3 w^-4 + A4 w^-6 + A5 w^-8;
    - powers: a1, p1, a2, p2, ... of n^2 = sum a w^p;
    - cauchy: n = A + B w^-2 + C w^-4 + ...;
    - conrady: n = A + B / w + C / w^3.5;
    - herzberger: n = A + B L + C L^2 + D w^2 + E w^4 + F w^6, L = 1 / (w^2 - 0.028);
    - buchdahl: n0, nu1, nu2, w0 of n = n0 + nu1 o + nu2 o^2, o = (w - w0) / (1 + 2.5 (w - w0)).

    Attributes:
        name: Strict name, "material-source".
        formula: How n follows from the wavelength.
        coefficients: See above.
        source: Where the coefficients come from.
        range_um: Wavelengths for which the source gives the coefficients.
        stated_index_d: n_d as the source prints it, if it does.
        stated_abbe_number: V_d as the source prints it, if it does.
    """

    name: str
    formula: Formula
    coefficients: tuple[float, ...]
    source: str
    range_um: tuple[float, float] = (0.0, math.inf)
    stated_index_d: float | None = field(default=None, compare=False)
    stated_abbe_number: float | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not self.name:
            raise ContractError("a glass needs a name; got none")
        if self.formula not in FORMULAS:
            raise ContractError(
                f"glass {self.name}: formula must be one of {', '.join(FORMULAS)}; "
                f"got {self.formula!r}"
            )
        count = len(self.coefficients)
        if not _COUNT_FITS[self.formula](count) or not all(map(math.isfinite, self.coefficients)):
            raise ContractError(
                f"glass {self.name}: {count} coefficients {self.coefficients} "
                f"do not fit the formula {self.formula}"
            )
        low, high = self.range_um
        if not 0 <= low < high:
            raise ContractError(f"glass {self.name}: range_um must be [low, high]; got {low, high}")
