"""Diffraction against closed forms; energy, window and the lens behind it."""

import math
from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.mtf import diffraction_mtf, mtf_of_psf
from camkit.models_def.optics.analysis.sampling import disc_quadrature
from camkit.models_def.optics.analysis.wave_psf import (
    irradiance_per_mm2,
    pupil_for_reach,
)
from camkit.models_def.optics.analysis.wavefront import Wavefront, trace_wavefront
from tests.physics.reference_lenses import thorlabs_al2550

WAVE_UM, F_NUMBER = 0.55, 4.0
UNIT_MM = WAVE_UM * F_NUMBER / 1000
RINGS = (1.21966989, 2.23313059, 3.23831548)


def _round_pupil(opd_waves: Callable[[Tensor], Tensor] = torch.zeros_like) -> Wavefront:
    samples = disc_quadrature(24, 64)
    assert samples.weight is not None
    aperture = 1 / (2 * F_NUMBER)
    share = (samples.weight * math.pi * aperture**2)[None, None]
    return Wavefront(
        l=(samples.x * aperture)[None, None],
        m=(samples.y * aperture)[None, None],
        opd_um=(opd_waves(samples.x**2 + samples.y**2) * WAVE_UM)[None, None],
        flux=share,
        amplitude=share,
        miss_mm=torch.zeros_like(share),
        wavelengths_um=torch.tensor([WAVE_UM], dtype=torch.float64),
        centre_mm=torch.zeros(1, dtype=torch.float64),
    )


def _grid(reach: float, count: int) -> Tensor:
    return torch.linspace(-reach, reach, count, dtype=torch.float64) * UNIT_MM


def test_airy_pattern_is_dark_at_its_zeros() -> None:
    place = torch.tensor([0.0, *RINGS], dtype=torch.float64) * UNIT_MM
    light = irradiance_per_mm2(_round_pupil(), place[:1], place)[0, 0, :, 0]
    assert bool((light[1:] < 1e-14 * light[0]).all())


def test_encircled_energy_equals_its_closed_form() -> None:
    """1 - J0^2 - J1^2; published at the zeros: .83778487, .90993054, .93764747."""
    place = _grid(4, 641)
    light = irradiance_per_mm2(_round_pupil(), place, place)[0, 0]
    radius, cell = torch.hypot(place[:, None], place), float(place[1] - place[0]) ** 2
    found = [float(light[radius <= ring * UNIT_MM].sum()) * cell for ring in RINGS]
    assert found == pytest.approx([0.83778487, 0.90993054, 0.93764747], abs=2e-5)


def test_full_width_at_half_maximum_of_the_airy_disc() -> None:
    half = torch.tensor([0.0, 1.02899397 / 2], dtype=torch.float64) * UNIT_MM
    light = irradiance_per_mm2(_round_pupil(), half, half[:1])[0, 0, 0]
    assert float(light[1] / light[0]) == pytest.approx(0.5, abs=1e-7)


@pytest.mark.parametrize(
    ("power", "waves", "expected"),
    [
        (1, 0.25, 0.81056947),
        (1, 0.5, 0.40528473),
        (1, 1.0, 0.0),
        (2, 0.25, 0.80030480),
        (2, 0.5, 0.39474132),
    ],
)
def test_strehl_of_defocus_and_spherical_aberration(
    power: int, waves: float, expected: float
) -> None:
    wavefront = _round_pupil(lambda square: waves * square**power)
    zero = torch.zeros(1, dtype=torch.float64)
    peak = irradiance_per_mm2(wavefront, zero, zero)
    perfect = irradiance_per_mm2(_round_pupil(), zero, zero)
    assert float(peak / perfect) == pytest.approx(expected, abs=6e-9)


def test_contrast_of_the_airy_pattern_is_the_diffraction_limit() -> None:
    """(2/pi)(acos v - v sqrt(1 - v^2)), from a window of +-12 wavelengths x f-number."""
    share = torch.tensor([0, 0.1, 0.25, 0.5, 0.75, 0.01, 0.003], dtype=torch.float64)
    expected = torch.tensor(
        [1, 0.87288857, 0.68503764, 0.39100222, 0.14429361], dtype=torch.float64
    )
    assert torch.allclose(diffraction_mtf(share)[:5], expected, rtol=0, atol=6e-9)
    place = _grid(12, 121)
    light = irradiance_per_mm2(_round_pupil(), place, place)
    pitch_mm = float(place[1] - place[0])
    whole = torch.full((1, 1), pitch_mm**-2, dtype=torch.float64)
    found = mtf_of_psf(light, pitch_mm * 1000, share / UNIT_MM, whole)
    assert torch.allclose(found.tangential[0], diffraction_mtf(share), rtol=0, atol=1.5e-3)
    assert torch.allclose(found.sagittal[0], found.tangential[0], rtol=0, atol=1e-12)


def test_tilt_of_the_wavefront_moves_the_spot_to_where_its_rays_go() -> None:
    """A path that grows with m (OPD falls) turns light towards smaller y, away from +m."""
    plain = _round_pupil()
    shift_mm = 1.5 * UNIT_MM
    tilted = Wavefront(
        l=plain.l,
        m=plain.m,
        opd_um=plain.m * shift_mm * 1000,
        flux=plain.flux,
        amplitude=plain.amplitude,
        miss_mm=plain.miss_mm,
        wavelengths_um=plain.wavelengths_um,
        centre_mm=plain.centre_mm,
    )
    place = _grid(3, 121)
    light = irradiance_per_mm2(tilted, place[60:61], place)[0, 0, :, 0]
    assert float(place[light.argmax()]) == pytest.approx(shift_mm, abs=1e-9)


def test_diffraction_limited_lens_gives_the_airy_pattern_of_its_cone() -> None:
    """AL2550-A at 0.78 um focuses to 63 pm: its light is that of a round pupil of its NA."""
    lens = thorlabs_al2550()
    slopes = torch.zeros(1, dtype=torch.float64)
    waves = torch.tensor([0.78], dtype=torch.float64)
    sine = 11.5 / 50.00163205
    samples = disc_quadrature(24, 64)
    assert samples.weight is not None
    share = samples.weight[None, None] * math.pi * sine**2
    cone = Wavefront(
        l=(samples.x * sine)[None, None],
        m=(samples.y * sine)[None, None],
        opd_um=torch.zeros_like(share),
        flux=share,
        amplitude=share,
        miss_mm=torch.zeros_like(share),
        wavelengths_um=waves,
        centre_mm=slopes,
    )
    place = torch.linspace(-0.005, 0.005, 81, dtype=torch.float64)
    traced = trace_wavefront(lens, slopes, waves, samples, "paraxial")
    found, expected = (irradiance_per_mm2(w, place, place) for w in (traced, cone))
    assert float((found - expected).abs().sum() / expected.sum()) < 0.03
    assert float(found.sum() / expected.sum()) == pytest.approx(1, abs=5e-3)


def test_blur_too_wide_for_waves_is_refused_with_the_way_out() -> None:
    with pytest.raises(ContractError, match="use the geometric PSF"):
        pupil_for_reach(10.0, 0.5, 0.2)
