import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import abbe_number, refractive_index
from camkit.models_def.optics.glass.material import FORMULAS, Formula, Glass

PRINTED = 6e-8
"""Half a unit of the seventh digit."""


@pytest.mark.parametrize(
    ("name", "wavelength_um", "index", "tolerance"),
    [
        ("N-BK7-Schott", 0.5875618, 1.5168000345, 1e-10),
        ("N-BK7-Schott", 0.4861327, 1.5223763, PRINTED),
        ("N-BK7-Schott", 0.78, 1.5111833, PRINTED),
        ("PMMA-Sultanova2009", 0.55, 1.4925878, PRINTED),
        ("PMMA-Sultanova2009", 0.6562725, 1.4878785, PRINTED),
        ("PC-Sultanova2009", 0.55, 1.5892281, PRINTED),
        ("PC-Sultanova2009", 0.4861327, 1.5995979, PRINTED),
        ("fused-silica-Malitson1965", 0.5875618, 1.4584637, PRINTED),
        ("fused-silica-Malitson1965", 0.6562725, 1.4563666, PRINTED),
        ("SK16-Hikari", 0.55, 1.6226085614386923, 1e-15),
        ("F2-Schott", 0.55, 1.623655122927604, 1e-15),
        ("PMMA-Misc", 0.55, 1.493581, 6e-7),
        ("N-SSK2-Schott", 0.4861327, 1.630452, 6e-7),
        ("N-SF57-Schott", 0.6562725, 1.836496, 6e-7),
        ("N-SK2-Schott", 0.5876, 1.6073788585843214, 3e-7),
        ("F5-Schott", 0.5876, 1.6034171781909698, 3e-7),
        ("N-SK16-Schott", 0.5876, 1.6204079330698105, 3e-7),
    ],
)
def test_index_equals_the_published_one(
    name: str, wavelength_um: float, index: float, tolerance: float
) -> None:
    wave = torch.tensor(wavelength_um, dtype=torch.float64)
    assert float(refractive_index(find_glass(name), wave)) == pytest.approx(index, abs=tolerance)


@pytest.mark.parametrize(
    ("name", "number"),
    [("N-BK7", 64.17), ("PMMA-Sultanova2009", 53.18), ("PC-Sultanova2009", 27.86)],
)
def test_abbe_number_equals_the_published_one(name: str, number: float) -> None:
    assert abbe_number(find_glass(name)) == pytest.approx(number, abs=6e-3)


W = 0.5
W2 = W * W
BY_HAND: dict[Formula, tuple[tuple[float, ...], float]] = {
    "constant": ((1.7,), 1.7),
    "sellmeier": ((1.1, 0.01, 0.2, 80.0), math.sqrt(1 + 1.1 * W2 / 0.24 + 0.2 * W2 / (W2 - 80))),
    "sellmeier_offset": ((2.1, 0.3, 0.01), math.sqrt(2.1 + 0.3 * W2 / 0.24)),
    "sellmeier_mixed": (
        (0.9, 0.5, 0.1, 0.02, 9.0),
        math.sqrt(1.9 + 0.5 * W2 / 0.24 + 0.02 / (W2 - 81)),
    ),
    "handbook_1": ((2.5, 0.03, 0.01, 0.02), math.sqrt(2.5 + 0.03 / 0.24 - 0.02 * W2)),
    "handbook_2": ((1.5, 1.0, 0.01, 0.02), math.sqrt(1.5 + W2 / 0.24 - 0.02 * W2)),
    "schott": (
        (2.2, -0.01, 0.01, 0.001, 1e-4, 1e-5),
        math.sqrt(2.2 - 0.01 * 0.25 + 0.04 + 0.016 + 0.0064 + 0.00256),
    ),
    "powers": ((2.2, 0.0, 0.01, -2.0, -0.02, 4.0), math.sqrt(2.2 + 0.04 - 0.02 / 16)),
    "cauchy": ((1.5, 0.004, 1e-4), 1.5 + 0.016 + 16e-4),
    "conrady": ((1.45, 0.0125, 6e-5), 1.45 + 0.025 + 6e-5 * 2**3.5),
    "herzberger": (
        (1.5, 0.01, 0.001, -0.01, 0.001, 1e-4),
        1.5 + 0.01 / 0.222 + 0.001 / 0.222**2 - 0.0025 + 0.001 / 16 + 1e-4 / 64,
    ),
    "buchdahl": (
        (1.5, -0.04, 0.003, 0.574),
        1.5 + 0.04 * 0.074 / 0.815 + 0.003 * (0.074 / 0.815) ** 2,
    ),
}


@pytest.mark.parametrize("formula", FORMULAS)
def test_formula_equals_the_sum_written_by_hand(formula: Formula) -> None:
    coefficients, index = BY_HAND[formula]
    glass = Glass(name="x", formula=formula, coefficients=coefficients, source="test")
    wave = torch.tensor([W], dtype=torch.float64)
    assert float(refractive_index(glass, wave)[0]) == pytest.approx(index, rel=1e-14)


def test_index_keeps_the_gradient_to_the_wavelength() -> None:
    wave = torch.tensor(0.55, dtype=torch.float64, requires_grad=True)
    refractive_index(find_glass("N-BK7"), wave).backward()
    assert wave.grad is not None
    assert -0.1 < float(wave.grad) < 0


def test_imaginary_index_is_refused() -> None:
    glass = Glass(name="x", formula="powers", coefficients=(-1.0, 0.0), source="test")
    with pytest.raises(ContractError, match="no real index"):
        refractive_index(glass, torch.tensor(0.5, dtype=torch.float64))
