"""The expected error of the bank against covariances that are inverted one by one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from camkit.models_def.design.assembly import parts_of, problem_of
from camkit.models_def.design.descent import Descending, descended
from camkit.models_def.design.design_recipe import to_design
from camkit.models_def.design.expected import GRID_PX, Descent, ExpectedError
from camkit.models_def.design.fabrication import draw_copy
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.design.lens_module import LensModule
from camkit.models_def.design.shipped_camera import Camera
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors
from camkit.models_def.sensors.wiener import to_otf
from tests.models_def.design.test_shipped_camera import RECIPES, behind_the_bank, camera

ERRORS = FabricationErrors()
DESCENT = Descent(rounds=1, evaluations=6, copies=2, iso=(100.0, 1600.0))


def lens_of(table: dict[str, Any]) -> DesignLens:
    return parts_of(behind_the_bank(table), folder=RECIPES).lens


def covariance_error(of: Camera, lens: DesignLens, copies: list[Any], iso: float) -> float:
    """Return the error at the axis in dB, from 3x3 covariances."""
    model, level = of.together, DESCENT.level
    sizes = (GRID_PX, GRID_PX)
    with torch.no_grad():
        h = to_otf(lens()[0][0, :1], sizes)[0].numpy()
        gaps = [to_otf(lens.made_kernels(c)[0, :1], sizes)[0].numpy() - h for c in copies]
    spread = np.mean([np.abs(gap) ** 2 for gap in gaps], axis=0)
    variance = of.variance_at(iso, level).numpy()
    turn = of.to_rec709.double().numpy()
    total = 0.0
    for row, fy in enumerate(np.fft.fftfreq(GRID_PX)):
        for column, fx in enumerate(np.fft.rfftfreq(GRID_PX)):
            if row == column == 0:
                continue
            f2 = fy * fy + fx * fx
            prior = model.scale * level**2 * (f2 + 512.0**-2) ** (-model.exponent / 2)
            scene = prior * (np.ones((3, 3)) + model.own * np.eye(3))
            rise = np.exp(np.array(model.noise) + 4 * np.array(model.noise_rise) * f2)
            noise = variance * rise + model.mistrust * spread[:, row, column] * prior
            blur = np.diag(h[:, row, column])
            seen = blur @ scene @ blur.conj().T + np.diag(noise)
            left = scene - scene @ blur.conj().T @ np.linalg.inv(seen) @ blur @ scene
            half = 1 if column in (0, GRID_PX // 2) else 2
            total += half * np.trace(turn @ left @ turn.T).real
    return float(-10 * np.log10(total))


def test_the_closed_form_is_what_covariances_leave(table: dict[str, Any]) -> None:
    lens, of = lens_of(table), camera()
    copies = [draw_copy(lens.problem.free.lens, ERRORS, number) for number in (1, 2)]
    with torch.no_grad():
        every_db, _ = ExpectedError(of, DESCENT, copies)(lens)
    assert every_db.shape == (2, 1, 3)
    for number, iso in enumerate(DESCENT.iso):
        wanted = covariance_error(of, lens, copies, iso)
        assert float(every_db[number, 0, 0]) == pytest.approx(wanted, abs=1e-6)


def test_its_gradient_is_that_of_finite_differences(table: dict[str, Any]) -> None:
    lens, of = lens_of(table), camera()
    lens.begin[-1] += 0.1
    copies = [draw_copy(lens.problem.free.lens, ERRORS, number) for number in (1, 2)]
    error = ExpectedError(of, DESCENT, copies)

    def value(moves: torch.Tensor) -> torch.Tensor:
        with torch.no_grad():
            lens.moves.copy_(moves)
        return error(lens)[0].mean()

    begin = torch.zeros_like(lens.moves)
    (slope,) = torch.autograd.grad(value(begin), lens.moves)
    for number in range(len(begin)):
        step = torch.zeros_like(begin)
        step[number] = 1e-4
        found = float((value(begin + step) - value(begin - step)).detach()) / 2e-4
        assert found == pytest.approx(float(slope[number]), rel=1e-2)


def test_a_lens_may_not_hide_its_blur_outside_the_window(table: dict[str, Any]) -> None:
    copies = [draw_copy(lens_of(table).problem.free.lens, ERRORS, 1)]
    penalties = []
    for kernel_px in (11, 129):
        behind_the_bank(table)
        table["pixels"]["kernel_px"] = kernel_px
        lens = parts_of(to_design(table), folder=RECIPES).lens
        with torch.no_grad():
            error = ExpectedError(camera(), DESCENT, copies)
            penalties.append(float(error(lens)[1] - lens()[1]))
    assert penalties[0] > 0.1
    assert penalties[1] == 0


def test_a_descent_improves_a_defocused_lens_and_never_ends_below_its_start(
    table: dict[str, Any],
) -> None:
    recipe = behind_the_bank(table)
    problem = problem_of(recipe, find_lens("duet"))
    pixels = parts_of(recipe, folder=RECIPES).lens.pixels
    begin = problem.free.scaled()
    begin[-1] += 0.1
    parts = Descending(
        descent=DESCENT,
        camera=camera(),
        fabrication=ERRORS,
        make=lambda scaled: LensModule(problem, pixels, scaled),
        seed=1,
    )

    def merit(scaled: torch.Tensor) -> float:
        lens = parts.make(scaled)
        with torch.no_grad():
            return float(parts.error_of(lens)(lens)[0].mean())

    end = descended(begin, parts)
    assert merit(end) > merit(begin) + 0.03
    one = replace(parts, descent=replace(DESCENT, evaluations=1))
    assert merit(descended(end, one)) >= merit(end)
