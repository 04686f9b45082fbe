"""Fields beyond 90 degrees against a trace of their own: spheres by centre, Snell by vectors."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.chief_path import chief_path
from camkit.models_def.optics.aiming.field import field_angle, field_slope, slope_of
from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.analysis.sampling import disc_quadrature
from camkit.models_def.optics.analysis.wavefront import trace_wavefront, wavefront_rms_um
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.optics.lens_file.zmx_field import FieldType, with_field_points
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.optics.render.illumination import relative_illumination_of
from camkit.models_def.optics.spot import chief_heights, tangents_for_heights
from camkit.models_def.optics.trace import surface_tensors, trace
from camkit.models_def.optics.tracing.meeting import State
from camkit.models_def.optics.tracing.steep import SteepSurface, cross_steep

# US 3,524,697 (Isshiki, Matsuki), example 1, scaled to 6 mm, without its plane filter
FISHEYE_MM = (
    *((53.20864, 2.69875, "model:1.61272,58.6"), (18.2052, 14.69322, "air")),
    *((53.75139, 2.33892, "model:1.62041,60.3"), (8.57664, 9.29571, "air")),
    *((-39.75085, 0.77964, "model:1.48848,70.3"), (10.27146, 3.47839, "model:1.7847,26.0")),
    *((35.73511, 3.26976, "air"), (math.inf, 3.23851, "air")),
    *((-1931.61786, 3.35845, "model:1.78477,26.0"), (8.8855, 6.77687, "model:1.74372,45.0")),
    *((-33.8034, 0.11994, "air"), (-183.5039, 2.87867, "model:1.76764,46.5")),
    *((-17.38478, 10.31524, "air"), (38.63237, 1.55928, "model:1.78485,26.0")),
    *((13.32825, 10.43518, "model:1.6223,53.1"), (-41.68556, 10.71129, "air")),
)
STOP = 7
EDGE_DEG = (89.4999, 89.5001)
WAVE = torch.tensor([0.5876], dtype=torch.float64)


def fisheye() -> Lens:
    """Return the lens of 220 degrees."""
    surfaces = tuple(
        Surface(curvature_per_mm=1 / radius, thickness_mm=gap, glass=glass)
        for radius, gap, glass in FISHEYE_MM
    )
    return Lens(
        name="fisheye",
        surfaces=surfaces,
        stop=STOP,
        aperture_kind="f_number",
        aperture_value=5.6,
        reference_wavelength_um=0.5876,
    )


def _slopes(*angles_deg: float) -> torch.Tensor:
    return field_slope(torch.deg2rad(torch.tensor(angles_deg, dtype=torch.float64)))


def _meridional(lens: Lens, angle_rad: float) -> Callable[[float], tuple[float, float]]:
    """Return what takes the height of a ray, across its own direction, to stop and sensor."""
    wave = torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    index = [1.0, *(float(refractive_index(s.medium, wave)) for s in lens.surfaces)]
    vertex = np.cumsum([0.0, *(s.thickness_mm for s in lens.surfaces)])

    def heights(height: float) -> tuple[float, float]:
        way = np.array([math.sin(angle_rad), math.cos(angle_rad)])
        place = height * np.array([way[1], -way[0]]) - 1000 * way
        at_stop = math.nan
        for i, surface in enumerate(lens.surfaces):
            if math.isinf(1 / surface.curvature_per_mm if surface.curvature_per_mm else math.inf):
                place = place + (vertex[i] - place[1]) / way[1] * way
                normal = np.array([0.0, 1.0])
            else:
                radius = 1 / surface.curvature_per_mm
                middle = np.array([0.0, vertex[i] + radius])
                ahead = (place - middle) @ way
                square = ahead**2 - (place - middle) @ (place - middle) + radius**2
                if square < 0:
                    return math.nan, math.nan
                place = place + (-ahead - math.copysign(math.sqrt(square), radius)) * way
                normal = (middle - place) / radius
            ratio, facing = index[i] / index[i + 1], normal @ way
            bent = 1 - ratio**2 * (1 - facing**2)
            if bent < 0:
                return math.nan, math.nan
            way = ratio * way + (math.sqrt(bent) - ratio * facing) * normal
            at_stop = place[0] if i == lens.stop else at_stop
        return at_stop, (place + (vertex[-1] - place[1]) / way[1] * way)[0]

    return heights


@given(st.floats(-139.0, 139.0))
def test_slopes_grow_with_the_angle_and_lead_back_to_it(angle_deg: float) -> None:
    angle = torch.tensor([angle_deg], dtype=torch.float64).deg2rad()
    slope = field_slope(angle)
    assert float(field_angle(slope)) == pytest.approx(float(angle), abs=1e-12)
    assert float(slope) == slope_of(float(angle)) or abs(angle_deg) < 89.5
    assert float(field_slope(angle + 1e-3)) > float(slope)
    if abs(angle_deg) < 89.5:
        assert torch.equal(slope, torch.tan(angle))


def test_chief_rays_land_where_another_trace_has_them() -> None:
    lens = fisheye()
    for angle_deg in (45.0, EDGE_DEG[0], 90.0, 110.0):
        slope = _slopes(angle_deg)
        heights = _meridional(lens, math.radians(angle_deg))
        lead = float(chief_path(lens).lead_at(slope))
        low, high = (-lead * math.sin(math.radians(angle_deg)) + step for step in (-0.2, 0.2))
        for _ in range(60):
            middle = (low + high) / 2
            same = heights(low)[0] * heights(middle)[0] > 0
            low, high = (middle, high) if same else (low, middle)
        landing = float(chief_heights(lens, slope)[0])
        assert landing == pytest.approx(heights(low)[1], abs=1e-9), angle_deg


def test_chief_rays_to_the_middle_of_a_ball_are_not_bent() -> None:
    radius_mm = 10.0
    halves = [
        Surface(curvature_per_mm=c, thickness_mm=radius_mm, glass="N-BK7-Schott")
        for c in (1 / radius_mm, 0.0)
    ]
    back = Surface(curvature_per_mm=-1 / radius_mm, thickness_mm=5.0)
    ball = replace(fisheye(), surfaces=(*halves, back), stop=1)
    path = chief_path(ball)
    assert math.degrees(path.angles_rad[-1]) > 89.9
    assert path.lead_mm == pytest.approx(radius_mm, abs=1e-6)
    wanted = (radius_mm + 5.0) * np.tan(path.angles_rad)
    assert path.heights_mm == pytest.approx(wanted, rel=1e-6)


def test_light_and_wavefront_do_not_jump_where_fields_become_steep() -> None:
    lens = fisheye()
    samples = disc_quadrature(6, 12)
    front = wavefront_rms_um(trace_wavefront(lens, _slopes(*EDGE_DEG), WAVE, samples, "stop"))
    light = relative_illumination_of(lens, _slopes(*EDGE_DEG, 110.0), WAVE, rays=128)[:, 0]
    assert float(front[0]) == pytest.approx(float(front[1]), rel=1e-4)
    assert float(light[0]) == pytest.approx(float(light[1]), rel=1e-4)
    assert 0.5 < float(light[2]) < float(light[1])


@pytest.mark.parametrize("name", ["curvature_per_mm", "conic", "thickness_mm", "index"])
def test_gradients_of_steep_rays_are_those_of_differences(name: str) -> None:
    lens = fisheye()
    tensors = surface_tensors(lens, WAVE[0])
    slope = _slopes(100.0, 100.0, 100.0)
    height = torch.tensor([-5.6, -5.45, -5.3], dtype=torch.float64)

    def landing(values: torch.Tensor) -> torch.Tensor:
        rays = launch(0 * height + 0.1, height, slope, math.inf)
        end = trace(replace(tensors, **{name: values}), rays, path=True)
        assert bool(end.valid.all())
        assert end.path_mm is not None
        return (end.y + end.x + end.path_mm).sum()

    start = getattr(tensors, name).clone().requires_grad_()
    landing(start).backward()  # type: ignore[no-untyped-call]
    for i in (0, 1, 3):
        step = torch.zeros_like(start)
        step[i] = 1e-7
        with torch.no_grad():
            difference = (landing(start + step) - landing(start - step)) / 2e-7
        assert float(start.grad[i]) == pytest.approx(float(difference), rel=1e-6, abs=1e-6)


def test_a_conic_is_met_by_newton_where_its_closed_form_has_it() -> None:
    angle = torch.deg2rad(torch.tensor([80.0, 90.0, 105.0], dtype=torch.float64))
    zero = torch.zeros_like(angle)
    place = (-2.0 * torch.cos(angle), 2.0 * torch.sin(angle))
    rays = State(zero, *place, zero, torch.sin(angle), torch.cos(angle))
    tensors = surface_tensors(fisheye(), WAVE[0])
    tensors = replace(tensors, conic=tensors.conic - 0.4)
    results = [
        cross_steep(
            SteepSurface(
                curvature=tensors.curvature_per_mm[1],
                conic=tensors.conic[1],
                profile=lambda rho: (tensors.height(1, rho), tensors.slope(1, rho)),
                aspheric=aspheric,
                reach_mm=tensors.semi_diameter_mm[1],
                before=tensors.index[0],
                after=tensors.index[1],
            ),
            rays,
            torch.zeros(3, dtype=torch.int8),
            None,
        )
        for aspheric in (True, False)
    ]
    assert results[0][1].tolist() == [0, 0, 0]
    for one, other in zip(results[0][0], results[1][0], strict=True):
        assert torch.allclose(one, other, atol=1e-12)


def test_heights_beyond_the_tangents_are_found_and_not_frozen() -> None:
    lens = fisheye()
    height_mm = chief_heights(lens, _slopes(105.0))
    wanted = r"a PSF .* to 89\.5 degrees = 8\.75 mm; the sensor's corner is at 105\.0 degrees"
    with pytest.raises(ContractError, match=wanted):
        tangents_for_heights(lens, height_mm, "a PSF")


def test_a_file_keeps_its_steep_fields() -> None:
    lens, notes = with_field_points(fisheye(), FieldType.ANGLE, [(0.0, 0.0), (0.0, 95.0)])
    assert np.degrees(lens.field_angles_rad) == pytest.approx([0.0, 95.0])
    assert not notes


def test_no_near_object_lies_beside_the_lens() -> None:
    wide = replace(fisheye(), field_angles_rad=(0.0, math.radians(100)))
    with pytest.raises(ContractError, match=r"0\.\.89\.5 degrees"):
        replace(wide, object_distance_mm=1000.0)
    assert with_object_distance(wide, 1000.0).field_angles_rad == (0.0,)
