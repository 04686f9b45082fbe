"""Fans against third order, closed forms, and another program."""

import math
from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.analysis.fans import trace_fans
from camkit.models_def.optics.analysis.seidel import seidel_sums
from camkit.models_def.optics.analysis.spots import field_slopes
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, Surface
from tests.physics.reference_lenses import cooke_triplet

OPTILAND = "0.6.3"
HALF, EDGE = 30, 40  # of 41 points: 0.5 and 1 of the pupil


def _cooke() -> Lens:
    return replace(
        cooke_triplet(),
        field_angles_rad=tuple(map(math.radians, (0, 14, 20))),
        wavelengths_um=(0.48, 0.55, 0.65),
        reference_wavelength_um=0.55,
    )


def _waves(lens: Lens) -> torch.Tensor:
    return torch.tensor(lens.wavelengths_um, dtype=torch.float64)


def test_fans_of_the_cooke_triplet_equal_optiland() -> None:
    """RayFan and OPDFan of 0.6.3; its OPD in waves has the sign of camkit's."""
    lens = _cooke()
    fans = trace_fans(lens, field_slopes(lens), _waves(lens), "paraxial", 41)
    tangential, sagittal = fans.tangential_mm, fans.sagittal_mm
    found = [float(tangential[i, j, EDGE]) for i, j in ((0, 1), (1, 0), (1, 1), (2, 2))]
    expected = [-0.004195677081, 0.039284648356, 0.040752951556, 0.036545592331]
    assert found == pytest.approx(expected, abs=2e-9)
    found = [float(sagittal[i, j, HALF]) for i, j in ((0, 1), (1, 0), (2, 2))]
    assert found == pytest.approx([0.006286457711, -0.007546339948, -0.007750257413], abs=2e-9)
    edges = (fans.tangential_opd_um[:, 1, 0] / 0.55).tolist()
    expected = [-0.589660968057, -1.600721604799, 0.897680702685]
    assert edges == pytest.approx(expected, abs=1e-8)


def test_spherical_aberration_of_a_singlet_is_of_third_order_for_small_pupils() -> None:
    """At the paraxial focus y = SA rho^3; what is left falls with the fourth power of the pupil."""
    errors = []
    for diameter_mm in (4.0, 2.0):
        lens = _singlet(diameter_mm)
        fans = trace_fans(lens, field_slopes(lens), _waves(lens), "paraxial", 41)
        third = seidel_sums(lens).transverse_mm()["SA"] * fans.pupil**3
        largest = float(third.abs().max())
        # a ray from above the axis lands below it where the marginal one crosses early
        errors.append(float((fans.tangential_mm[0, 0] - third).abs().max()) / largest)
        assert torch.allclose(fans.tangential_mm, fans.sagittal_mm, atol=1e-12)
    assert errors[0] < 0.01
    assert errors[1] == pytest.approx(errors[0] / 4, rel=0.1)


def _singlet(diameter_mm: float) -> Lens:
    front = Surface(curvature_per_mm=1 / 25.75, thickness_mm=5.34, glass="N-BK7-Schott")
    lens = Lens(
        name="singlet",
        surfaces=(front, Surface(curvature_per_mm=0.0, thickness_mm=44.0)),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=diameter_mm,
        field_angles_rad=(0.0,),
        wavelengths_um=(0.55,),
        reference_wavelength_um=0.55,
    )
    focus_mm = paraxial_data(lens).bfl_mm
    return replace(lens, surfaces=(front, replace(lens.surfaces[1], thickness_mm=focus_mm)))


def test_the_slope_of_the_opd_is_the_transverse_aberration() -> None:
    """d OPD / d (direction cosine) = landing: paths and landings are traced apart."""
    lens = _singlet(4.0)
    fans = trace_fans(lens, field_slopes(lens), _waves(lens), "paraxial", 401)
    opd_mm, height_mm = fans.tangential_opd_um[0, 0] / 1000, fans.tangential_mm[0, 0]
    radius_mm = paraxial_data(lens).efl_mm
    step_mm = float(fans.pupil[1] - fans.pupil[0]) * 2.0
    slope = (opd_mm[2:] - opd_mm[:-2]) / (2 * step_mm) * radius_mm
    assert torch.allclose(slope.abs(), height_mm[1:-1].abs(), atol=3e-3 * float(height_mm.max()))


def test_lost_rays_are_gaps_and_a_field_without_chief_ray_is_empty() -> None:
    lens = _cooke()
    narrow = replace(lens.surfaces[0], semi_diameter_mm=6.0)
    clipped = replace(lens, surfaces=(narrow, *lens.surfaces[1:]))
    wide = torch.tan(torch.tensor([0.0, math.radians(20), math.radians(89)], dtype=torch.float64))
    fans = trace_fans(clipped, wide, _waves(lens), "stop")
    assert bool(torch.isfinite(fans.tangential_mm[0]).all())
    assert bool(torch.isnan(fans.tangential_mm[1]).any())
    assert bool(torch.isfinite(fans.tangential_mm[1]).any())
    assert torch.equal(torch.isnan(fans.tangential_mm), torch.isnan(fans.tangential_opd_um))
    assert bool(torch.isnan(fans.sagittal_mm[2]).all())
