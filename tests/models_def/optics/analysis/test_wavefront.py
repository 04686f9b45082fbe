"""Wavefronts against a CODE V listing and lenses that have none."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.models_def.optics.analysis.sampling import disc_quadrature
from camkit.models_def.optics.analysis.wavefront import trace_wavefront, wavefront_rms_um
from camkit.models_def.optics.prescription import Lens, Surface, read_prescription
from camkit.models_def.optics.pupil import PupilSamples
from tests.physics.reference_lenses import cooke_triplet

PRESCRIPTIONS = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"
LISTED_WAVES = 6e-4
INDEX = 1.5168000345


def _waves(*wavelengths_um: float) -> torch.Tensor:
    return torch.tensor(wavelengths_um, dtype=torch.float64)


def test_axial_opd_of_the_double_gauss_equals_code_v() -> None:
    lens = read_prescription(PRESCRIPTIONS / "double-gauss-f2.toml")
    lens = replace(lens, reference_wavelength_um=0.5876)
    zones = PupilSamples(x=_waves(0, 0, 0, 0), y=_waves(1.0, 0.8, 0.6, 0.4))
    found = trace_wavefront(lens, _waves(0.0), _waves(0.5876), zones, "paraxial").opd_um / 0.5876
    assert found[0, 0].tolist() == pytest.approx([-3.137, -3.775, -4.052, -2.636], abs=LISTED_WAVES)


def _hyperbolic(object_distance_mm: float = math.inf) -> Lens:
    return Lens(
        name="perfect",
        surfaces=(
            Surface(curvature_per_mm=0.0, thickness_mm=4.0, glass="N-BK7-Schott"),
            Surface(curvature_per_mm=-1 / (50 * (INDEX - 1)), thickness_mm=50.0, conic=-(INDEX**2)),
        ),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=20.0,
        object_distance_mm=object_distance_mm,
        reference_wavelength_um=0.5875618,
    )


def test_plano_hyperbolic_lens_has_no_wavefront_error_on_the_axis() -> None:
    wavefront = trace_wavefront(
        _hyperbolic(), _waves(0.0), _waves(0.5875618), disc_quadrature(6, 12)
    )
    assert float(wavefront.opd_um.abs().max()) < 1e-5


def test_defocus_is_the_difference_of_two_spheres() -> None:
    """A sensor moved by d from the focus of a cone: OPD = d (1 - cos u), to second order in d."""
    lens = _hyperbolic()
    last = replace(lens.surfaces[-1], thickness_mm=50.02)
    moved = replace(lens, surfaces=(lens.surfaces[0], last))
    edge = PupilSamples(x=_waves(0.0), y=_waves(1.0))
    wavefront = trace_wavefront(moved, _waves(0.0), _waves(0.5875618), edge, "paraxial")
    cosine = math.sqrt(1 - float(wavefront.m) ** 2)
    assert abs(float(wavefront.opd_um)) == pytest.approx(20 * (1 - cosine), rel=3e-3)


def test_rms_is_free_of_mean_and_tilt_and_converges() -> None:
    lens, slopes = cooke_triplet(), torch.tan(_waves(0, math.radians(14)))
    coarse, fine = (
        wavefront_rms_um(trace_wavefront(lens, slopes, _waves(0.55), disc_quadrature(*n)))
        for n in ((8, 16), (16, 32))
    )
    assert torch.allclose(coarse, fine, rtol=1e-5)
    blue = trace_wavefront(lens, slopes, _waves(0.55), disc_quadrature(8, 16))
    tilted = replace(blue, opd_um=blue.opd_um + 3.0 + 40 * blue.m - 9 * blue.l)
    assert torch.allclose(wavefront_rms_um(tilted), coarse, rtol=1e-9)


def test_slope_of_the_opd_is_the_ray_s_distance_from_the_chief_ray() -> None:
    """-d OPD / d m = y on the sensor (transverse ray aberration), here by central differences."""
    lens, step = cooke_triplet(), 1e-3
    pair = PupilSamples(x=_waves(0, 0, 0), y=_waves(0.7 - step, 0.7, 0.7 + step))
    found = trace_wavefront(lens, _waves(0.25), _waves(0.55), pair, "paraxial")
    opd, m = found.opd_um[0, 0], found.m[0, 0]
    slope_mm = float((opd[2] - opd[0]) / (m[2] - m[0])) / 1000
    assert abs(slope_mm) == pytest.approx(float(found.miss_mm[0, 0, 1]), rel=2e-4)


def test_near_object_s_wavefront_is_that_of_its_cone() -> None:
    """An object far away and one at infinity give the same OPD."""
    near = replace(cooke_triplet(), object_distance_mm=1e8)
    points = disc_quadrature(4, 8)
    slopes, waves = _waves(0.2), _waves(0.55)
    far = trace_wavefront(cooke_triplet(), slopes, waves, points)
    found = trace_wavefront(near, slopes, waves, points)
    assert torch.allclose(found.opd_um, far.opd_um, rtol=0, atol=2e-3)


def test_lost_rays_carry_no_light() -> None:
    lens = cooke_triplet()
    narrow = replace(lens.surfaces[-1], semi_diameter_mm=4.5)
    wavefront = trace_wavefront(
        replace(lens, surfaces=(*lens.surfaces[:-1], narrow)),
        _waves(0.0, 0.8),
        _waves(0.55),
        disc_quadrature(6, 12),
    )
    lost = wavefront.flux == 0
    assert bool(lost.any())
    assert bool((wavefront.amplitude[lost] == 0).all())
    assert bool(torch.isfinite(wavefront.opd_um).all())


def test_a_sensor_in_the_exit_pupil_has_no_wavefront() -> None:
    """No sphere about a point of it holds the rays that start there."""
    lens = replace(_hyperbolic(), stop=1)
    last = replace(lens.surfaces[-1], thickness_mm=1e-6)
    at_stop = replace(lens, surfaces=(lens.surfaces[0], last))
    found = trace_wavefront(at_stop, _waves(0.0), _waves(0.5875618), disc_quadrature(3, 6))
    assert math.isnan(float(wavefront_rms_um(found)))
