import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.search.problem import Problem, trace_batch
from camkit.models_def.optics.search.recovery import (
    RecoveryMerit,
    expected_loss,
    recovery_residuals,
    splat_batch,
)

MERIT = RecoveryMerit(
    pitch_um=6.0, kernel_px=33, color_weights=torch.full((3, 3), 1 / 3, dtype=torch.float64)
)


def gaussian(sigma_px: float) -> torch.Tensor:
    line = torch.arange(-16, 17, dtype=torch.float64)
    bell = torch.exp(-0.5 * (line / sigma_px) ** 2)
    return torch.outer(bell, bell) / bell.sum() ** 2


def test_a_perfect_lens_loses_nothing_and_a_wider_blur_loses_more() -> None:
    dot = torch.zeros(33, 33, dtype=torch.float64)
    dot[16, 16] = 1
    losses = [float(expected_loss(k, MERIT)) for k in (dot, *map(gaussian, (0.7, 1.5, 3.0)))]
    assert losses[0] == pytest.approx(0, abs=1e-12)
    assert losses == sorted(losses)
    assert losses[-1] > losses[1] + 0.5


def test_the_expected_error_is_that_of_the_filter_on_random_scenes() -> None:
    """Gaussian scenes of the stated spectrum, blurred, with noise, through the Wiener filter."""
    kernel, size = gaussian(1.5), 64
    rng = np.random.default_rng(7)
    fy, fx = np.fft.fftfreq(size)[:, None], np.fft.fftfreq(size)[None]
    ratio = MERIT.signal_to_noise * (fy**2 + fx**2 + 1 / size**2) ** (-MERIT.exponent / 2)
    otf = np.fft.fft2(np.pad(kernel.numpy(), (0, size - 33)))
    gain = np.conj(otf) * ratio / (np.abs(otf) ** 2 * ratio + 1)
    plain = ratio / (ratio + 1)
    errors = np.zeros(2)
    for _ in range(60):
        scene = np.fft.fft2(rng.standard_normal((size, size))) * np.sqrt(ratio)
        noise = np.fft.fft2(rng.standard_normal((size, size)))
        for i, (transfer, undo) in enumerate(((otf, gain), (np.ones_like(otf), plain))):
            errors[i] += np.mean(np.abs(undo * (transfer * scene + noise) - scene) ** 2)
    found = float(expected_loss(kernel, MERIT))
    assert found == pytest.approx(math.log(errors[0] / errors[1]), abs=0.05)


def test_kernels_hold_all_light_that_lands_in_the_window(problem: Problem) -> None:
    traced = trace_batch(problem, problem.free.scaled()[None], torch.inf)
    kernels = splat_batch(traced.landed, MERIT)
    assert kernels.shape == (1, 2, 3, 33, 33)
    torch.testing.assert_close(kernels.sum((-2, -1)), torch.ones(1, 2, 3, dtype=torch.float64))
    torch.testing.assert_close(kernels, kernels.flip(-1))


def test_defocus_raises_the_residuals(problem: Problem) -> None:
    scaled = problem.free.scaled()
    away = scaled.clone()
    away[-1] = 1.0
    found = [
        float(
            recovery_residuals(trace_batch(problem, s[None], torch.inf).landed, MERIT)
            .square()
            .sum()
        )
        for s in (scaled, away)
    ]
    assert found[1] > found[0] + 0.3


def test_an_even_window_is_refused() -> None:
    with pytest.raises(ContractError, match="odd"):
        replace(MERIT, kernel_px=32)
