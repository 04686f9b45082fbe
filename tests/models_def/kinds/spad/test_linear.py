"""The best linear filter."""

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.linear import fit_linear
from camkit.models_def.networks.bicubic import Bicubic


def _pairs(count: int, noise: float = 0.0) -> list[tuple[torch.Tensor, torch.Tensor]]:
    generator = torch.Generator().manual_seed(1)
    made = []
    for _ in range(count):
        light = torch.rand(1, 1, 24, 24, generator=generator)
        grain = noise * torch.randn(1, 1, 24, 24, generator=generator)
        made.append((light + grain, Bicubic()(light)))
    return made


def test_what_a_linear_filter_made_is_found_again() -> None:
    pairs = _pairs(3)
    found = fit_linear(pairs)
    for light, fine in pairs:
        assert torch.allclose(found(light), fine, atol=1e-4)
    assert torch.allclose(found.bias, torch.zeros(16), atol=1e-3)


def test_planes_that_tell_of_noise_are_passed_over() -> None:
    found = fit_linear(_pairs(2))
    planes = torch.rand(1, 2, 8, 8)
    assert torch.equal(found(planes), found(planes[:, :1]))
    assert found(planes).shape == (1, 1, 32, 32)


def test_in_noise_it_beats_interpolation_and_every_scaled_self() -> None:
    pairs = _pairs(6, noise=0.3)
    found = fit_linear(pairs)

    def error(factor: float) -> float:
        gaps = [
            (factor * (found(light) - found.bias.mean()) + found.bias.mean() - fine).square()
            for light, fine in pairs
        ]
        return float(torch.cat(gaps).mean())

    plain = np.mean([float((Bicubic()(light) - fine).square().mean()) for light, fine in pairs])
    assert error(1.0) < 0.7 * plain
    assert error(1.0) < min(error(0.95), error(1.05))


def test_nothing_to_fit_to_is_refused() -> None:
    with pytest.raises(ContractError, match="at least one pair"):
        fit_linear([])
