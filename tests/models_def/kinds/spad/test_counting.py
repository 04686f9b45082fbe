"""Photons counted: Poisson statistics, what is told of them, gradients through them."""

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.counting import (
    Exposure,
    count_softly,
    draw_counts,
    expose,
    told_planes,
)

MANY = (1, 1, 400, 500)


@pytest.mark.parametrize(("photons", "light"), [(1.0, 0.3), (30.0, 0.5), (1e4, 0.9)])
def test_counts_have_the_mean_the_variance_and_the_zeros_of_poisson(
    photons: float, light: float
) -> None:
    exposure = Exposure(photons=photons)
    counts = draw_counts(torch.full(MANY, light), exposure, np.random.default_rng(1)).numpy()
    expected, pixels = photons * light, counts.size
    assert (counts == counts.round()).all()
    assert counts.mean() == pytest.approx(expected, abs=5 * (expected / pixels) ** 0.5)
    assert counts.var() == pytest.approx(
        expected, rel=5 * (2 / pixels + 1 / expected / pixels) ** 0.5
    )
    empty = np.exp(-expected)
    assert (counts == 0).mean() == pytest.approx(empty, abs=5 * (empty / pixels) ** 0.5 + 1e-9)


def test_dark_counts_add_and_fewer_photons_are_detected() -> None:
    exposure = Exposure(photons=200.0, detected=0.25, dark_counts=7.0)
    assert exposure.white_counts == 50
    rng = np.random.default_rng(2)
    counts = draw_counts(torch.full(MANY, 0.4), exposure, rng)
    assert float(counts.mean()) == pytest.approx(27, abs=0.1)
    light = told_planes(counts, exposure)[:, 0]
    assert float(light.mean()) == pytest.approx(0.4, abs=2e-3)


def test_the_told_noise_is_three_deviations() -> None:
    """3 sqrt((y + 1/N) / N) without dark counts; dark ones make it as wide as they are."""
    y, photons = torch.tensor([0.0, 0.2, 1.0]), 50.0
    told = told_planes((y * photons).reshape(1, 1, 1, 3), Exposure(photons=photons))
    assert torch.allclose(told[0, 0, 0], y)
    assert torch.allclose(told[0, 1, 0], 3 * torch.sqrt((y + 1 / photons) / photons))
    exposure = Exposure(photons=500.0, dark_counts=300.0)
    planes = expose(torch.full(MANY, 0.3), exposure, np.random.default_rng(3))
    assert float(planes[:, 1].mean() / 3) == pytest.approx(float(planes[:, 0].std()), rel=0.01)


def test_infinitely_many_photons_make_no_noise() -> None:
    light = torch.rand(1, 1, 4, 4)
    planes = expose(light, Exposure(photons=float("inf")), np.random.default_rng(0))
    assert torch.equal(planes[:, :1], light)
    assert not planes[:, 1].any()
    with pytest.raises(ContractError, match="finite number of photons"):
        draw_counts(light, Exposure(photons=float("inf")), np.random.default_rng(0))


def test_a_pixel_with_more_light_counts_more() -> None:
    exposure = Exposure(photons=10.0, detected=0.5, dark_counts=2.0).brighter(16)
    assert (exposure.photons, exposure.detected, exposure.dark_counts) == (160, 0.5, 2)


def test_soft_counts_are_true_counts() -> None:
    light = torch.full(MANY, 0.3)
    photons = torch.full((1, 1, 1, 1), 20.0)
    found = count_softly(light, photons, torch.Generator().manual_seed(1)) * 20
    assert torch.allclose(found, found.round(), atol=1e-4)
    assert float(found.mean()) == pytest.approx(6, abs=0.03)
    assert float(found.var()) == pytest.approx(6, rel=0.02)


def test_the_slope_of_soft_counts_is_that_of_mean_and_deviation() -> None:
    """d E[y^2] / d light of Poisson counts is 2 light + 1 / N: the noise grows with the light."""
    light = torch.full(MANY, 0.5, requires_grad=True)
    photons = torch.full((1, 1, 1, 1), 8.0)
    found = count_softly(light, photons, torch.Generator().manual_seed(2))
    found.square().mean().backward()
    assert light.grad is not None
    assert float(light.grad.sum()) == pytest.approx(2 * 0.5 + 1 / 8, rel=0.01)


def test_darkness_has_no_noise_and_a_finite_slope() -> None:
    light = torch.zeros(1, 1, 8, 8, requires_grad=True)
    found = count_softly(light, torch.full((1, 1, 1, 1), 100.0), torch.Generator().manual_seed(3))
    assert not found.any()
    found.sum().backward()
    assert light.grad is not None
    assert torch.isfinite(light.grad).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"photons": 0.0}, "photons must be > 0"),
        ({"photons": float("nan")}, "photons must be > 0"),
        ({"photons": 1.0, "detected": 1.5}, r"detected in \(0, 1\]"),
        ({"photons": 1.0, "dark_counts": -1.0}, "dark_counts must be a number >= 0"),
        ({"photons": 1.0, "dark_counts": float("inf")}, "dark_counts must be a number >= 0"),
    ],
)
def test_an_impossible_exposure_is_refused(arguments: dict[str, float], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        Exposure(**arguments)


def test_negative_light_is_refused() -> None:
    with pytest.raises(ContractError, match="light must be >= 0"):
        draw_counts(torch.tensor([[-0.1]]), Exposure(photons=1.0), np.random.default_rng(0))
