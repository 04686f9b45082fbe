"""Bicubic interpolation at the true place of the samples."""

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import Bicubic, bicubic_filters, cubic


def _keys(x: float, a: float = -0.5) -> float:
    x = abs(x)
    if x <= 1:
        return (a + 2) * x**3 - (a + 3) * x**2 + 1
    return a * x**3 - 5 * a * x**2 + 8 * a * x - 4 * a if x < 2 else 0.0


def _written_out(samples: np.ndarray, scale: int, phase: int) -> np.ndarray:
    """Every sub-pixel by itself, from the 4x4 samples around it."""
    height, width = samples.shape
    fine = np.zeros((scale * height, scale * width))
    for y in range(scale * height):
        for x in range(scale * width):
            v, u = (y - phase) / scale, (x - phase) / scale
            for k in range(int(np.floor(v)) - 1, int(np.floor(v)) + 3):
                for j in range(int(np.floor(u)) - 1, int(np.floor(u)) + 3):
                    held = samples[min(max(k, 0), height - 1), min(max(j, 0), width - 1)]
                    fine[y, x] += held * _keys(v - k) * _keys(u - j)
    return fine


@pytest.mark.parametrize(("scale", "phase"), [(4, 2), (4, 0), (4, 3), (3, 1), (2, 0)])
def test_sub_pixels_are_those_written_out_borders_included(scale: int, phase: int) -> None:
    samples = np.random.default_rng(phase).random((5, 7))
    given = torch.from_numpy(samples).float()[None, None]
    found = Bicubic(scale, phase)(given)[0, 0].numpy()
    np.testing.assert_allclose(found, _written_out(samples, scale, phase), atol=2e-6)


def test_samples_stay_as_they_are_at_their_own_sub_pixel() -> None:
    samples = torch.rand(2, 3, 6, 5)
    for phase in range(4):
        fine = Bicubic(4, phase)(samples)
        assert torch.allclose(fine[..., phase::4, phase::4], samples, atol=1e-6)


def test_channels_do_not_mix_and_an_even_picture_stays_even() -> None:
    samples = torch.rand(1, 2, 6, 6)
    assert torch.equal(Bicubic()(samples)[:, 1:], Bicubic()(samples[:, 1:]))
    assert torch.allclose(Bicubic()(torch.ones(1, 1, 4, 4)), torch.ones(1, 1, 16, 16), atol=1e-6)
    assert torch.allclose(bicubic_filters(4, 1).sum((1, 2, 3)), torch.ones(16), atol=1e-6)


def test_the_cubic_has_its_textbook_values() -> None:
    found = cubic(torch.tensor([0.0, 0.5, 1.0, 1.5, 2.0, 3.0], dtype=torch.float64))
    np.testing.assert_allclose(found, [1, 0.5625, 0, -0.0625, 0, 0], atol=1e-15)


@pytest.mark.parametrize("phase", [-1, 4])
def test_a_phase_outside_the_pixel_is_refused(phase: int) -> None:
    with pytest.raises(ContractError, match="phase must be one of the sub-pixels"):
        bicubic_filters(4, phase)
