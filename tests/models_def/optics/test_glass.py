import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.glass import (
    abbe_number,
    cauchy_glass,
    find_glass,
    glass_names,
    refractive_index,
)

PRINTED = 6e-8
"""Half a unit of the seventh digit."""


@pytest.mark.parametrize(
    ("name", "wavelength_um", "index"),
    [
        ("N-BK7-Schott", 0.5875618, 1.5168000345),
        ("N-BK7-Schott", 0.4861327, 1.5223763),
        ("N-BK7-Schott", 0.78, 1.5111833),
        ("PMMA-Sultanova2009", 0.55, 1.4925878),
        ("PMMA-Sultanova2009", 0.6562725, 1.4878785),
        ("PC-Sultanova2009", 0.55, 1.5892281),
        ("PC-Sultanova2009", 0.4861327, 1.5995979),
        ("fused-silica-Malitson1965", 0.5875618, 1.4584637),
        ("fused-silica-Malitson1965", 0.6562725, 1.4563666),
        ("SK16-Hikari", 0.55, 1.6226085614386923),
        ("F2-Schott", 0.55, 1.623655122927604),
    ],
)
def test_index_equals_the_published_one(name: str, wavelength_um: float, index: float) -> None:
    wave = torch.tensor(wavelength_um, dtype=torch.float64)
    assert float(refractive_index(find_glass(name), wave)) == pytest.approx(index, abs=PRINTED)


@pytest.mark.parametrize(
    ("name", "wavelength_um", "index"),
    [
        ("N-SSK2-Schott", 0.4861327, 1.630452),
        ("N-SSK2-Schott", 0.6562725, 1.618771),
        ("N-SF57-Schott", 0.5875618, 1.846660),
        ("N-SF57-Schott", 0.6562725, 1.836496),
    ],
)
def test_index_equals_the_catalogue_to_six_digits(
    name: str, wavelength_um: float, index: float
) -> None:
    wave = torch.tensor(wavelength_um, dtype=torch.float64)
    assert float(refractive_index(find_glass(name), wave)) == pytest.approx(index, abs=6e-7)


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("N-BK7-Schott", 64.17),
        ("PMMA-Sultanova2009", 53.18),
        ("PC-Sultanova2009", 27.86),
        ("N-SF57-Schott", 23.78),
    ],
)
def test_abbe_number_equals_the_published_one(name: str, number: float) -> None:
    assert abbe_number(find_glass(name)) == pytest.approx(number, abs=6e-3)


def test_cauchy_glass_follows_equation_6_8() -> None:
    glass = cauchy_glass("PMMA-test", index_d=1.491756, abbe_number=58.0, source="dO")
    assert glass.coefficients[0] == pytest.approx(1.4789761, abs=2e-5)
    wave = torch.tensor([0.4861, 0.5893, 0.6563], dtype=torch.float64)
    n_f, n_d, n_c = refractive_index(glass, wave).tolist()
    assert n_d == pytest.approx(1.491756, abs=1e-12)
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(58.0, abs=1e-9)


def test_cauchy_glass_refuses_an_index_below_one() -> None:
    with pytest.raises(ContractError, match="index > 1"):
        cauchy_glass("x", index_d=0.9, abbe_number=58.0, source="x")


@pytest.mark.parametrize("name", ["PC", "pmma", "N-BK7", "BK7", "", "PMMA-sultanova2009"])
def test_glass_name_is_never_guessed(name: str) -> None:
    with pytest.raises(ContractError, match="glass must be a known name"):
        find_glass(name)


def test_unknown_glass_names_its_near_matches() -> None:
    with pytest.raises(ContractError, match="N-BK7-Schott"):
        find_glass("BK7")


def test_every_glass_names_its_source() -> None:
    assert all(find_glass(name).source for name in glass_names())
