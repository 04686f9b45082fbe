"""The indices and Abbe numbers that go with the published lenses, each row as printed."""

from collections.abc import Sequence

import pytest
import torch

from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import (
    C_LINE_UM,
    D_LINE_UM,
    F_LINE_UM,
    abbe_number,
    refractive_index,
)
from camkit.models_def.optics.glass.material import Glass
from camkit.models_def.optics.glass.model_glass import cauchy_glass

SEVEN, SIX = 6e-8, 6e-7
LINES_UM = (F_LINE_UM, 0.55, D_LINE_UM, C_LINE_UM)
CODE_V_LINES_UM = (0.6563, 0.5876, 0.4861)


def _indices(glass: Glass, wavelengths_um: Sequence[float]) -> list[float]:
    found: list[float] = refractive_index(
        glass, torch.tensor(wavelengths_um, dtype=torch.float64)
    ).tolist()
    return found


@pytest.mark.parametrize(
    ("name", "indices", "number", "digits"),
    [
        ("N-BK7-Schott", (1.5223763, 1.5185224, 1.5168000, 1.5143223), 64.17, SEVEN),
        ("PMMA-Sultanova2009", (1.4971048, 1.4925878, 1.4906182, 1.4878785), 53.18, SEVEN),
        ("PC-Sultanova2009", (1.5995979, 1.5892281, 1.5847626, 1.5786073), 27.86, SEVEN),
        ("fused-silica-Malitson1965", (1.4631265, 1.4599109, 1.4584637, 1.4563666), 67.82, SEVEN),
        ("N-SSK2-Schott", (1.630452, 1.624785, 1.622294, 1.618771), 53.27, SIX),
        ("N-SF57-Schott", (1.872100, 1.854148, 1.846660, 1.836496), 23.78, SIX),
    ],
)
def test_index_and_abbe_number_are_those_of_the_table(
    name: str, indices: Sequence[float], number: float, digits: float
) -> None:
    glass = find_glass(name)
    assert _indices(glass, LINES_UM) == pytest.approx(indices, abs=digits)
    assert abbe_number(glass) == pytest.approx(number, abs=6e-3)


@pytest.mark.parametrize(
    ("name", "indices", "number"),
    [
        ("PMMA-Misc", (1.497763, 1.493581, 1.491754, 1.489199), 57.4),
        ("POLYCARB-Misc", (1.599446, 1.589593, 1.585468, 1.579863), 29.9),
    ],
)
def test_plastics_of_the_misc_catalogue_are_those_of_deeplens(
    name: str, indices: Sequence[float], number: float
) -> None:
    """Printed for F, d and C, whose wavelengths that program rounds to a tenth of a nanometre.

    Its copy of the catalogue has coefficients of fewer digits.
    """
    glass = find_glass(name)
    assert _indices(glass, (0.4861, 0.55, 0.5876, 0.6563)) == pytest.approx(indices, abs=2e-6)
    assert abbe_number(glass) == pytest.approx(number, abs=0.05)


def test_n_bk7_has_its_catalogue_index_to_ten_digits() -> None:
    assert _indices(find_glass("N-BK7-Schott"), (D_LINE_UM, 0.78)) == pytest.approx(
        [1.5168000345, 1.5111833], abs=SEVEN
    )


@pytest.mark.parametrize(
    ("name", "indices"),
    [
        ("N-SSK2-Schott", (1.618769, 1.6222915007887073, 1.630455)),
        ("N-SK2-Schott", (1.604134, 1.6073788585843214, 1.614860)),
        ("F5-Schott", (1.598744, 1.6034171781909698, 1.614617)),
        ("N-SK16-Schott", (1.617271, 1.6204079330698105, 1.627559)),
    ],
)
def test_schott_s_glasses_have_the_indices_of_code_v_s_listing(
    name: str, indices: Sequence[float]
) -> None:
    assert _indices(find_glass(name), CODE_V_LINES_UM) == pytest.approx(indices, abs=SIX)


@pytest.mark.parametrize(
    ("name", "terms", "indices"),
    [
        ("cauchy:1.491756,58", (1.4789761, 4438.1295), (1.497758, 1.493648, 1.489280)),
        ("cauchy:1.585470,30", (1.5560536, 10215.5485), (1.599286, 1.589824, 1.579771)),
    ],
)
def test_two_term_cauchy_glasses_are_those_of_equation_6_8(
    name: str, terms: Sequence[float], indices: Sequence[float]
) -> None:
    """From n_D at 589.3 nm and V; A and B (in nm^2) and three indices as another program has."""
    glass = find_glass(name)
    a, b = glass.coefficients
    assert a == pytest.approx(terms[0], abs=6e-8)
    assert 1e6 * b == pytest.approx(terms[1], abs=6e-5)
    found = _indices(glass, (0.4861, 0.55, 0.6563))
    assert found == pytest.approx(indices, abs=SIX)


@pytest.mark.parametrize(
    ("name", "misses"),
    [
        ("PC-Sultanova2009", (-1.6e-4, -1.6e-4, -5.7e-4, -2.9e-4)),
        ("PMMA-Sultanova2009", (-3.7e-5, -3.7e-5, -1.3e-4, -6.7e-5)),
    ],
)
def test_two_terms_through_the_d_line_miss_the_sellmeier_index_as_published(
    name: str, misses: Sequence[float]
) -> None:
    """At F, C, 450 and 700 nm; the constant follows from n_d, the slope from V_d."""
    waves = (F_LINE_UM, C_LINE_UM, 0.45, 0.7)
    glass = find_glass(name)
    (index_d,) = _indices(glass, (D_LINE_UM,))
    slope = (index_d - 1) / abbe_number(glass) / (F_LINE_UM**-2 - C_LINE_UM**-2)
    found = [
        index_d + slope * (w**-2 - D_LINE_UM**-2) - n
        for w, n in zip(waves, _indices(glass, waves), strict=True)
    ]
    assert found == pytest.approx(misses, rel=0.03)


def test_mixing_up_the_d_lines_shifts_pmma_by_8e_5() -> None:
    """Eq. (6.8) takes the sodium line, catalogues state the helium line."""
    sodium = cauchy_glass("x", index_d=1.491756, abbe_number=58)
    (as_helium,) = _indices(sodium, (D_LINE_UM,))
    assert as_helium - 1.491756 == pytest.approx(8e-5, abs=5e-6)
