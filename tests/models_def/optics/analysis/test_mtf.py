"""Contrast of spots and PSFs with known transforms."""

import math
from dataclasses import replace

import pytest
import torch
from scipy.special import j0, j1

from camkit.models_def.optics.analysis.mtf import (
    diffraction_limit,
    diffraction_mtf,
    geometric_mtf,
    mtf_of_psf,
)
from camkit.models_def.optics.analysis.sampling import pupil_samples, rim_samples
from camkit.models_def.optics.analysis.wavefront import trace_wavefront
from camkit.models_def.optics.spot import Spots
from tests.physics.reference_lenses import cooke_triplet, thorlabs_al2550


def _disc(radius_x_mm: float, radius_y_mm: float) -> Spots:
    samples = pupil_samples("gauss:20x80")
    assert samples.weight is not None
    return Spots(
        x_mm=(samples.x * radius_x_mm)[None, None],
        y_mm=(samples.y * radius_y_mm + 7.0)[None, None],
        weight=samples.weight[None, None],
        chief_y_mm=torch.tensor([7.0], dtype=torch.float64),
        fate=torch.zeros(1, 1, len(samples.x), dtype=torch.int8),
    )


def test_contrast_of_a_uniform_disc_is_the_jinc() -> None:
    """2 J1(a) / a with a = 2 pi f r; tangential follows y, sagittal x."""
    cycles = torch.tensor([0.0, 10.0, 30.0, 55.0], dtype=torch.float64)
    found = geometric_mtf(_disc(0.01, 0.02), cycles)
    for contrast, radius in ((found.sagittal, 0.01), (found.tangential, 0.02)):
        a = 2 * math.pi * cycles[1:] * radius
        expected = torch.abs(2 * torch.from_numpy(j1(a.numpy())) / a)
        assert torch.allclose(contrast[0, 1:], expected, rtol=0, atol=1e-10)
        assert float(contrast[0, 0]) == pytest.approx(1, abs=1e-12)


def test_contrast_of_spots_carries_gradients() -> None:
    spots = _disc(0.01, 0.01)
    scale = torch.ones((), dtype=torch.float64, requires_grad=True)
    grown = replace(spots, x_mm=spots.x_mm * scale)
    cycles = torch.tensor([20.0], dtype=torch.float64)
    geometric_mtf(grown, cycles).sagittal.sum().backward()
    a = 2 * math.pi * 20 * 0.01
    expected = -2 * float(j0(a)) + 4 * float(j1(a)) / a
    # d/da (2 J1 / a) = 2 J0 / a - 4 J1 / a^2, times a for the scale
    assert scale.grad is not None
    assert float(scale.grad) == pytest.approx(-expected, rel=1e-9)


def test_colours_that_land_apart_lower_the_contrast() -> None:
    spots = _disc(0.001, 0.001)
    both = replace(
        spots,
        x_mm=spots.x_mm.expand(1, 2, -1),
        y_mm=torch.cat([spots.y_mm, spots.y_mm + 0.01], dim=1),
        weight=spots.weight.expand(1, 2, -1),
    )
    cycles = torch.tensor([50.0], dtype=torch.float64)
    assert float(geometric_mtf(both, cycles).tangential) < 1e-12
    assert float(geometric_mtf(both, cycles).sagittal) > 0.95


def test_contrast_of_a_psf_of_two_points() -> None:
    """|cos(pi f d)| along the line that joins them, 1 across it."""
    psf = torch.zeros(1, 1, 9, 9, dtype=torch.float64)
    psf[0, 0, 2, 4] = psf[0, 0, 6, 4] = 3.0
    cycles = torch.tensor([0.0, 20.0, 60.0], dtype=torch.float64)
    found = mtf_of_psf(psf, 2.0, cycles)
    expected = torch.abs(torch.cos(math.pi * cycles * 0.008))
    assert torch.allclose(found.tangential[0], expected, rtol=0, atol=1e-12)
    assert torch.allclose(found.sagittal[0], torch.ones(3, dtype=torch.float64))


def test_diffraction_limit_on_the_axis_is_that_of_the_f_number_and_less_off_it() -> None:
    lens = cooke_triplet()
    slopes = torch.tensor([0.0, math.tan(math.radians(20))], dtype=torch.float64)
    waves = torch.tensor([0.55], dtype=torch.float64)
    rim = trace_wavefront(lens, slopes, waves, pupil_samples("hexapolar:8"), "paraxial")
    cycles = torch.tensor([100.0, 200.0], dtype=torch.float64)
    limit = diffraction_limit(rim, cycles)
    axis = diffraction_mtf(cycles * 0.55e-3 * 5)
    assert torch.allclose(limit.tangential[0], axis, rtol=0, atol=3e-3)
    assert torch.allclose(limit.sagittal[0], limit.tangential[0], rtol=0, atol=1e-9)
    # tangential: the cone shrinks by the cosine of the chief ray, squared by the longer way
    assert bool((limit.tangential[1] < limit.sagittal[1]).all())
    assert bool((limit.sagittal[1] < limit.sagittal[0]).all())


@pytest.mark.parametrize("open_share", [1.0, 0.999, 0.95, 0.7])
def test_diffraction_limit_is_that_of_the_light_a_stop_lets_pass(open_share: float) -> None:
    """Rims are rounded in files: one that is a hair smaller than the beam closes only a hair."""
    lens = replace(thorlabs_al2550(), aperture_value=5.0)
    rim_mm = lens.aperture_value / 2 * open_share
    front = replace(lens.surfaces[0], semi_diameter_mm=rim_mm)
    lens = replace(lens, surfaces=(front, *lens.surfaces[1:]))
    waves = torch.tensor([0.78], dtype=torch.float64)
    rim = trace_wavefront(lens, torch.zeros(1, dtype=torch.float64), waves, rim_samples())
    cycles = torch.tensor([10.0, 40.0, 90.0], dtype=torch.float64)
    sine = min(rim_mm, lens.aperture_value / 2) / 50.0016
    expected = diffraction_mtf(cycles * 0.78e-3 / (2 * sine))
    limit = diffraction_limit(rim, cycles)
    assert limit.tangential[0].tolist() == pytest.approx(expected.tolist(), abs=4e-3)
    assert limit.sagittal[0].tolist() == pytest.approx(expected.tolist(), abs=4e-3)
