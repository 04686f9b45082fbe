"""The refractive index at a wavelength, in torch, checked against the valid range."""

from collections.abc import Callable
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.glass.material import Formula, Glass

D_LINE_UM: Final = 0.5875618
F_LINE_UM: Final = 0.4861327
C_LINE_UM: Final = 0.6562725

RANGE_TOLERANCE: Final = 0.05
"""Share of each end of its range by which a glass may be asked beyond it (0.02 um at 0.4 um)."""

_HERZBERGER_UM2: Final = 0.028
_BUCHDAHL_PER_UM: Final = 2.5

_Coefficients = tuple[float, ...]


def refractive_index(glass: Glass, wavelengths_um: Tensor) -> Tensor:
    """Return the index relative to air.

    Args:
        glass: From `find_glass`, a catalogue, or `model_glass`.
        wavelengths_um: Any shape, float64.

    Raises:
        ContractError: If a wavelength lies outside the range of the glass by more than
            `RANGE_TOLERANCE`, or the formula has no real value there. Nothing is extrapolated.
    """
    low, high = glass.range_um
    waves = wavelengths_um.detach()
    outside = (waves < low * (1 - RANGE_TOLERANCE)) | (waves > high * (1 + RANGE_TOLERANCE))
    if bool(outside.any()):
        raise ContractError(
            f"glass {glass.name} is known for {low:g}..{high:g} um (its source: {glass.source}); "
            f"got {float(waves[outside].flatten()[0]):g} um; choose other wavelengths or a glass "
            "with a wider range"
        )
    index = _FORMULAS[glass.formula](glass.coefficients, wavelengths_um)
    if not bool((torch.isfinite(index) & (index > 0)).all()):
        raise ContractError(
            f"glass {glass.name} has no real index at {waves.flatten().tolist()} um; "
            "check its coefficients"
        )
    return index


def abbe_number(glass: Glass) -> float:
    """Return V_d = (n_d - 1) / (n_F - n_C); inf without dispersion."""
    lines = torch.tensor([D_LINE_UM, F_LINE_UM, C_LINE_UM], dtype=torch.float64)
    n_d, n_f, n_c = refractive_index(glass, lines).tolist()
    return float((n_d - 1) / (n_f - n_c)) if n_f != n_c else float("inf")


def index_and_abbe(glass: Glass) -> tuple[float, float]:
    """Return n_d and V_d as a lens file holds them; 0 where the glass has none."""
    low, high = glass.range_um
    if not (low * (1 - RANGE_TOLERANCE) <= 0.4861 and high * (1 + RANGE_TOLERANCE) >= 0.6563):
        return 0.0, 0.0
    line = torch.tensor(D_LINE_UM, dtype=torch.float64)
    number = abbe_number(glass)
    return float(refractive_index(glass, line)), number if number != float("inf") else 0.0


def _constant(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    return torch.full_like(wavelengths_um, coefficients[0])


def _sum_of_poles(coefficients: _Coefficients, w2: Tensor) -> Tensor:
    pairs = zip(coefficients[::2], coefficients[1::2], strict=True)
    return sum((b * w2 / (w2 - c) for b, c in pairs), torch.zeros_like(w2))


def _sellmeier(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    return torch.sqrt(1 + _sum_of_poles(coefficients, wavelengths_um**2))


def _sellmeier_offset(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    return torch.sqrt(coefficients[0] + _sum_of_poles(coefficients[1:], wavelengths_um**2))


def _sellmeier_mixed(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    a, b, c, d, e = coefficients
    w2 = wavelengths_um**2
    return torch.sqrt(1 + a + b * w2 / (w2 - c**2) + d / (w2 - e**2))


def _handbook_1(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    a, b, c, d = coefficients
    w2 = wavelengths_um**2
    return torch.sqrt(a + b / (w2 - c) - d * w2)


def _handbook_2(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    a, b, c, d = coefficients
    w2 = wavelengths_um**2
    return torch.sqrt(a + b * w2 / (w2 - c) - d * w2)


def _schott(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    powers = (0, 2, -2, -4, -6, -8)
    terms = (a * wavelengths_um**p for a, p in zip(coefficients, powers, strict=True))
    return torch.sqrt(sum(terms, torch.zeros_like(wavelengths_um)))


def _powers(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    pairs = zip(coefficients[::2], coefficients[1::2], strict=True)
    terms = (a * wavelengths_um**p for a, p in pairs)
    return torch.sqrt(sum(terms, torch.zeros_like(wavelengths_um)))


def _cauchy(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    terms = (a * wavelengths_um ** (-2 * i) for i, a in enumerate(coefficients))
    return sum(terms, torch.zeros_like(wavelengths_um))


def _conrady(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    a, b, c = coefficients
    return a + b / wavelengths_um + c / wavelengths_um**3.5


def _herzberger(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    a, b, c, d, e, f = coefficients
    w2 = wavelengths_um**2
    pole = 1 / (w2 - _HERZBERGER_UM2)
    return a + b * pole + c * pole**2 + d * w2 + e * w2**2 + f * w2**3


def _buchdahl(coefficients: _Coefficients, wavelengths_um: Tensor) -> Tensor:
    base, first, second, base_um = coefficients
    offset_um = wavelengths_um - base_um
    chromatic = offset_um / (1 + _BUCHDAHL_PER_UM * offset_um)
    return base + first * chromatic + second * chromatic**2


_FORMULAS: Final[dict[Formula, Callable[[_Coefficients, Tensor], Tensor]]] = {
    "constant": _constant,
    "sellmeier": _sellmeier,
    "sellmeier_offset": _sellmeier_offset,
    "sellmeier_mixed": _sellmeier_mixed,
    "handbook_1": _handbook_1,
    "handbook_2": _handbook_2,
    "schott": _schott,
    "powers": _powers,
    "cauchy": _cauchy,
    "conrady": _conrady,
    "herzberger": _herzberger,
    "buchdahl": _buchdahl,
}
