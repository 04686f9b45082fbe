"""Waves on pixels against closed forms of round and annular pupils (docs of `optics-notes`)."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.pupil_fit import FIT_GRIDS, half_quadrature
from camkit.models_def.optics.analysis.wave_kernels import (
    CoarsePupil,
    is_smooth,
    normalised,
    pixel_light,
    summed_light,
    waves_of,
)

WAVE_UM, F_NUMBER = 0.55, 4.0
UNIT_UM = WAVE_UM * F_NUMBER
FINE_UM = UNIT_UM / 40


def _round_pupil(opd_waves: Callable[[Tensor], Tensor] = torch.zeros_like) -> CoarsePupil:
    grid = FIT_GRIDS[0]
    samples = half_quadrature(grid.rings, grid.arms)
    aperture = 1 / (2 * F_NUMBER)

    def shaped(values: Tensor) -> Tensor:
        return values[None, None]

    return CoarsePupil(
        grid=grid,
        l=shaped(samples.x * aperture),
        m=shaped(samples.y * aperture),
        opd_um=shaped(opd_waves(samples.x**2 + samples.y**2) * WAVE_UM),
        area=shaped(torch.ones_like(samples.x)),
        margins=torch.zeros(0, 1, 1, len(samples.x), dtype=torch.float64),
        miss_mm=shaped(torch.zeros_like(samples.x)),
        wavelengths_um=torch.tensor([WAVE_UM], dtype=torch.float64),
    )


def _annular_pupil(inner: float) -> CoarsePupil:
    coarse = _round_pupil()
    samples = half_quadrature(coarse.grid.rings, coarse.grid.arms)
    hole = (inner**2 - samples.x**2 - samples.y**2)[None, None, None]
    return replace(coarse, margins=hole)


def _profile(coarse: CoarsePupil, side_px: int = 161, pitch_um: float = FINE_UM) -> Tensor:
    """Return the light from the middle outwards on pixels much smaller than the pattern."""
    light = summed_light(coarse, side_px, pitch_um)[0, 0]
    return light[side_px // 2, side_px // 2 :]


def _airy(units: Tensor) -> Tensor:
    v = (math.pi * units).clamp_min(1e-9)
    return (2 * torch.special.bessel_j1(v) / v) ** 2


def test_airy_pattern_equals_its_closed_form() -> None:
    """(2 J1(v) / v)^2; a tent of 1/40 of the unit widens it by 2e-4 at most."""
    light = _profile(_round_pupil())
    units = torch.arange(len(light), dtype=torch.float64) / 40
    assert float((light / light[0] - _airy(units)).abs().max()) < 3e-4
    # the peak of all light in 1 unit^2 is pi / 4
    assert float(light[0]) * 40**2 == pytest.approx(math.pi / 4, rel=1e-3)


@pytest.mark.parametrize(
    ("power", "waves", "expected"),
    [
        (1, 0.25, 0.81056947),
        (1, 0.5, 0.40528473),
        (2, 0.25, 0.80030480),
        (2, 0.5, 0.39474132),
    ],
)
def test_strehl_ratio_of_defocus_and_spherical_aberration(
    power: int, waves: float, expected: float
) -> None:
    peak = _profile(_round_pupil(lambda square: waves * square**power), 3)[0]
    assert float(peak / _profile(_round_pupil(), 3)[0]) == pytest.approx(expected, abs=2e-4)


def test_annular_pupil_equals_its_closed_form() -> None:
    """((2 J1(v)/v - e^2 2 J1(e v)/(e v)) / (1 - e^2))^2; a point at an edge counts by its cell."""
    inner = 0.4
    light = _profile(_annular_pupil(inner))
    units = torch.arange(len(light), dtype=torch.float64) / 40
    root, inner_root = (
        2 * torch.special.bessel_j1(v) / v
        for v in (scale * (math.pi * units).clamp_min(1e-9) for scale in (1.0, inner))
    )
    expected = ((root - inner**2 * inner_root) / (1 - inner**2)) ** 2
    assert float((light / light[0] - expected).abs().max()) < 4e-3
    waves = waves_of(_annular_pupil(inner), 0, 0, 161, FINE_UM)
    whole = waves_of(_round_pupil(), 0, 0, 161, FINE_UM)
    assert float(waves.flux.sum() / whole.flux.sum()) == pytest.approx(1 - inner**2, rel=5e-3)


@pytest.mark.parametrize("pitch_um", [0.9, 2.0, 6.0])
def test_pixels_hold_the_light_of_their_tents(pitch_um: float) -> None:
    """The sum of fine pixels under a tent, computed the slow way."""
    coarse = _round_pupil(lambda square: 0.7 * square - 0.4 * square**2)
    found = summed_light(coarse, 5, pitch_um)[0, 0]
    parts = 24
    side = 2 * 3 * parts + 1
    fine = summed_light(coarse, side, pitch_um / parts)[0, 0]
    place = (torch.arange(side, dtype=torch.float64) - side // 2) / parts
    pixel = torch.arange(5, dtype=torch.float64)[:, None] - 2
    tent = (1 - (place - pixel).abs()).clamp_min(0)
    assert torch.allclose(found, tent @ fine @ tent.T, atol=2e-4 * float(found.max()))


def test_light_is_kept() -> None:
    """1 - J0^2 - J1^2 within a disc; a square of 40 units in radius holds a little more."""
    light = float(summed_light(_round_pupil(), 45, 2 * 40.5 * UNIT_UM / 45).sum())
    assert 0.995 < light < 0.9985


def test_kernels_sum_to_1_and_say_what_they_hold() -> None:
    psf = normalised(summed_light(_round_pupil(), 5, 1.0))
    assert float(psf.kernels.sum()) == pytest.approx(1)
    assert 0.5 < float(psf.energy_kept) < 1


def test_gradient_of_the_light_is_that_of_differences() -> None:
    coarse = _round_pupil(lambda square: 0.3 * square)
    samples = half_quadrature(coarse.grid.rings, coarse.grid.arms)
    coma = ((samples.x**2 + samples.y**2) * samples.y)[None, None] * WAVE_UM

    def sharpness(waves: Tensor) -> Tensor:
        return (
            summed_light(replace(coarse, opd_um=coarse.opd_um + waves * coma), 9, 1.5)
            .square()
            .sum()
        )

    waves = torch.tensor(0.4, dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(sharpness(waves), waves)
    step = 1e-2
    with torch.no_grad():
        rise = (sharpness(waves + step) - sharpness(waves - step)) / (2 * step)
    assert float(slope) == pytest.approx(float(rise), rel=1e-3)


def test_paths_that_are_no_polynomials_are_told() -> None:
    assert is_smooth(_round_pupil(lambda square: 5 * square**3))
    assert not is_smooth(_round_pupil(lambda square: torch.sin(40 * square)))


def test_even_side_and_dark_pupil_are_refused() -> None:
    with pytest.raises(ContractError, match="odd"):
        summed_light(_round_pupil(), 4, 1.0)
    dark = waves_of(_round_pupil(), 0, 0, 5, 1.0)
    with pytest.raises(ContractError, match="no light"):
        pixel_light(replace(dark, amplitude=torch.zeros_like(dark.amplitude)), 5, 1.0)
