from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.search.problem import Problem, trace_batch
from camkit.models_def.optics.search.splat import Pixels, splat_batch

PIXELS = Pixels(
    pitch_um=6.0, kernel_px=33, color_weights=torch.full((3, 3), 1 / 3, dtype=torch.float64)
)


def test_kernels_hold_all_light_that_lands_in_the_window(problem: Problem) -> None:
    traced = trace_batch(problem, problem.free.scaled()[None], torch.inf)
    kernels = splat_batch(traced.landings, PIXELS)
    assert kernels.shape == (1, 2, 3, 33, 33)
    torch.testing.assert_close(kernels.sum((-2, -1)), torch.ones(1, 2, 3, dtype=torch.float64))
    torch.testing.assert_close(kernels, kernels.flip(-1))


def test_defocus_spreads_the_light(problem: Problem) -> None:
    scaled = problem.free.scaled()
    away = scaled.clone()
    away[-1] = 1.0
    landed = [trace_batch(problem, s[None], torch.inf).landings for s in (scaled, away)]
    peaks = [splat_batch(rays, PIXELS).amax((-2, -1)) for rays in landed]
    assert bool((peaks[1] < 0.5 * peaks[0]).all())


def test_an_even_window_is_refused() -> None:
    with pytest.raises(ContractError, match="odd"):
        replace(PIXELS, kernel_px=32)
