import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.glass.catalogue import builtin_catalogues, find_glass
from camkit.models_def.optics.glass.dispersion import abbe_number, refractive_index
from camkit.models_def.optics.glass.model_glass import cauchy_glass, model_glass


def _index(name: str, *waves_um: float) -> list[float]:
    values = refractive_index(find_glass(name), torch.tensor(waves_um, dtype=torch.float64))
    return [float(value) for value in values]


def test_model_glass_meets_its_index_abbe_number_and_partial_dispersion() -> None:
    n_d, n_f, n_c, n_g = _index("model:1.6,40.0,0.01", 0.5875618, 0.4861327, 0.6562725, 0.4358343)
    assert n_d == pytest.approx(1.6, abs=1e-14)
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(40, rel=1e-10)
    assert (n_g - n_f) / (n_f - n_c) == pytest.approx(0.6438 - 0.001682 * 40 + 0.01, rel=1e-9)


def test_model_glass_is_as_near_to_real_ones_as_its_docstring_says() -> None:
    waves = torch.tensor([0.4358343, 0.7], dtype=torch.float64)
    off = []
    for glass in builtin_catalogues()[0].glasses:
        if glass.stated_index_d and glass.stated_abbe_number and glass.range_um[0] < 0.43:
            model = model_glass(glass.stated_index_d, glass.stated_abbe_number)
            off.append(abs(refractive_index(model, waves) - refractive_index(glass, waves)).numpy())
    assert len(off) > 150
    blue, red = np.array(off).T
    assert np.median(red) < 3e-5
    assert np.percentile(red, 95) < 1.5e-4
    assert np.median(blue) < 1.2e-4
    assert np.percentile(blue, 95) < 6e-4


def test_abbe_number_zero_means_no_dispersion() -> None:
    assert _index("model:1.5,0", 0.4, 0.5, 10.6) == [1.5] * 3
    assert abbe_number(find_glass("model:1.5,0")) == float("inf")


def test_name_of_a_model_glass_becomes_canonical() -> None:
    assert find_glass("model: 1.5168, 64.17").name == "model:1.5168,64.17"
    assert find_glass("model:1.5168,64.17,0").name == "model:1.5168,64.17"
    assert find_glass("cauchy:1.491756,58").name == "cauchy:1.491756,58.0"


@pytest.mark.parametrize(
    "name", ["model:1.5", "model:", "model:a,b", "model:1,2,3,4", "cauchy:1.5,50,0", "model:nan,50"]
)
def test_damaged_model_name_is_refused(name: str) -> None:
    with pytest.raises(ContractError, match="model glass"):
        find_glass(name)


@pytest.mark.parametrize("numbers", [(0.9, 50.0), (1.5, -1.0), (1.5, 50.0, 2.0), (11.0, 50.0)])
def test_impossible_model_glass_is_refused(numbers: tuple[float, ...]) -> None:
    with pytest.raises(ContractError, match="a model glass needs"):
        model_glass(*numbers)


def test_cauchy_glass_follows_equation_6_8() -> None:
    glass = cauchy_glass("PMMA-test", index_d=1.491756, abbe_number=58.0)
    assert glass.coefficients[0] == pytest.approx(1.4789761, abs=2e-5)
    assert glass.coefficients[1] == pytest.approx(4438.1295e-6, abs=1e-5)
    n_f, n_d, n_c = _index("cauchy:1.491756,58", 0.4861, 0.5893, 0.6563)
    assert n_d == pytest.approx(1.491756, abs=1e-12)
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(58.0, abs=1e-9)


@pytest.mark.parametrize(("index", "number"), [(0.9, 58.0), (1.5, 0.0), (1.5, float("inf"))])
def test_cauchy_glass_refuses_impossible_numbers(index: float, number: float) -> None:
    with pytest.raises(ContractError, match="index > 1"):
        cauchy_glass("x", index_d=index, abbe_number=number)
