"""Glasses by strict name: the name carries its source, an unknown one is an error."""

import difflib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import torch
from torch import Tensor

from camkit.errors import ContractError

Formula = Literal["constant", "sellmeier", "cauchy", "schott"]

D_LINE_UM: Final = 0.5875618
F_LINE_UM: Final = 0.4861327
C_LINE_UM: Final = 0.6562725
SODIUM_LINE_UM: Final = 0.5893
CAUCHY_F_UM: Final = 0.4861
CAUCHY_C_UM: Final = 0.6563


@dataclass(frozen=True, slots=True, kw_only=True)
class Glass:
    """One optical material.

    Attributes:
        name: Strict name, "material-source".
        formula: How n follows from the wavelength.
        coefficients: constant: (n,); sellmeier: B1, C1, B2, C2, ... of
            n^2 = 1 + sum B w^2 / (w^2 - C); cauchy: A, B, ... of n = A + B / w^2 + ...;
            schott: A0..A5 of n^2 = A0 + A1 w^2 + A2 w^-2 + A3 w^-4 + A4 w^-6 + A5 w^-8;
            w is the wavelength in um.
        source: Where the coefficients come from.
    """

    name: str
    formula: Formula
    coefficients: tuple[float, ...]
    source: str


_SCHOTT_CATALOGUE: Final = "Schott optical glass catalogue, relative to air, 20 degrees C"

_GLASSES: Final[tuple[Glass, ...]] = (
    Glass(name="air", formula="constant", coefficients=(1.0,), source="reference medium"),
    Glass(
        name="PMMA-Sultanova2009",
        formula="sellmeier",
        coefficients=(1.1819, 0.011313),
        source="Sultanova, Kasarova, Nikolov 2009, Acta Phys. Pol. A 116, 585",
    ),
    Glass(
        name="PC-Sultanova2009",
        formula="sellmeier",
        coefficients=(1.4182, 0.021304),
        source="Sultanova, Kasarova, Nikolov 2009, Acta Phys. Pol. A 116, 585",
    ),
    Glass(
        name="fused-silica-Malitson1965",
        formula="sellmeier",
        coefficients=(
            *(0.6961663, 0.0684043**2),
            *(0.4079426, 0.1162414**2),
            *(0.8974794, 9.896161**2),
        ),
        source="Malitson 1965, J. Opt. Soc. Am. 55, 1205",
    ),
    Glass(
        name="N-BK7-Schott",
        formula="sellmeier",
        coefficients=(
            *(1.03961212, 0.00600069867),
            *(0.231792344, 0.0200179144),
            *(1.01046945, 103.560653),
        ),
        source=_SCHOTT_CATALOGUE,
    ),
    Glass(
        name="N-SSK2-Schott",
        formula="sellmeier",
        coefficients=(
            *(1.4306027, 0.00823982975),
            *(0.153150554, 0.0333736841),
            *(1.01390904, 106.870822),
        ),
        source=_SCHOTT_CATALOGUE,
    ),
    Glass(
        name="N-SF57-Schott",
        formula="sellmeier",
        coefficients=(
            *(1.87543831, 0.0141749518),
            *(0.37375749, 0.0640509927),
            *(2.30001797, 177.389795),
        ),
        source=_SCHOTT_CATALOGUE,
    ),
    Glass(
        name="F2-Schott",
        formula="sellmeier",
        coefficients=(
            *(1.34533359, 0.00997743871),
            *(0.209073176, 0.0470450767),
            *(0.937357162, 111.886764),
        ),
        source=_SCHOTT_CATALOGUE,
    ),
    Glass(
        name="SK16-Hikari",
        formula="schott",
        coefficients=(
            *(2.592001, -0.01540969, 0.0102268),
            *(0.001581559, -0.0001877149, 1.012515e-5),
        ),
        source="Hikari optical glass catalogue",
    ),
)

_BY_NAME: Final = {glass.name: glass for glass in _GLASSES}


def glass_names() -> tuple[str, ...]:
    """Give every glass name that a prescription may use."""
    return tuple(_BY_NAME)


def find_glass(name: str) -> Glass:
    """Give the glass of exactly this name.

    Raises:
        ContractError: If there is none; the message names near matches. Nothing is guessed.
    """
    if name in _BY_NAME:
        return _BY_NAME[name]
    wanted = name.casefold()
    near = [known for known in _BY_NAME if wanted and wanted in known.casefold()]
    near = near or difflib.get_close_matches(name, _BY_NAME, n=3, cutoff=0.3) or list(_BY_NAME)
    raise ContractError(
        f"glass must be a known name with its source; got {name!r}; write {' or '.join(near)}"
    )


def cauchy_glass(name: str, *, index_d: float, abbe_number: float, source: str) -> Glass:
    """Make a two-term Cauchy glass from its sodium-line index and Abbe number.

    References: Sun 2021, eq. (6.7) and (6.8); D is 589.3 nm, F 486.1 nm, C 656.3 nm.
    """
    if not (index_d > 1 and abbe_number > 0):
        raise ContractError(f"need index > 1 and Abbe number > 0; got {index_d}, {abbe_number}")
    spread = abbe_number * (CAUCHY_F_UM**-2 - CAUCHY_C_UM**-2)
    b = (index_d - 1) / spread
    a = index_d - b / SODIUM_LINE_UM**2
    return Glass(name=name, formula="cauchy", coefficients=(a, b), source=source)


def _constant(coefficients: tuple[float, ...], wavelengths_um: Tensor) -> Tensor:
    return torch.full_like(wavelengths_um, coefficients[0])


def _sellmeier(coefficients: tuple[float, ...], wavelengths_um: Tensor) -> Tensor:
    w2 = wavelengths_um**2
    pairs = zip(coefficients[::2], coefficients[1::2], strict=True)
    return torch.sqrt(1 + sum((b * w2 / (w2 - c) for b, c in pairs), torch.zeros_like(w2)))


def _cauchy(coefficients: tuple[float, ...], wavelengths_um: Tensor) -> Tensor:
    terms = (a * wavelengths_um ** (-2 * i) for i, a in enumerate(coefficients))
    return sum(terms, torch.zeros_like(wavelengths_um))


def _schott(coefficients: tuple[float, ...], wavelengths_um: Tensor) -> Tensor:
    powers = (0, 2, -2, -4, -6, -8)
    terms = (a * wavelengths_um**p for a, p in zip(coefficients, powers, strict=True))
    return torch.sqrt(sum(terms, torch.zeros_like(wavelengths_um)))


_FORMULAS: Final[dict[Formula, Callable[[tuple[float, ...], Tensor], Tensor]]] = {
    "constant": _constant,
    "sellmeier": _sellmeier,
    "cauchy": _cauchy,
    "schott": _schott,
}


def refractive_index(glass: Glass, wavelengths_um: Tensor) -> Tensor:
    """Give the index relative to air.

    Args:
        glass: From `find_glass` or `cauchy_glass`.
        wavelengths_um: Any shape, float64.
    """
    return _FORMULAS[glass.formula](glass.coefficients, wavelengths_um)


def abbe_number(glass: Glass) -> float:
    """Give V_d = (n_d - 1) / (n_F - n_C)."""
    lines = torch.tensor([D_LINE_UM, F_LINE_UM, C_LINE_UM], dtype=torch.float64)
    n_d, n_f, n_c = refractive_index(glass, lines).tolist()
    return float((n_d - 1) / (n_f - n_c))
