"""Surfaces with a phase: the grating equation, focal lengths by wavelength, a peer's rays."""

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.aim import aim
from camkit.models_def.optics.analysis.seidel import seidel_sums
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image
from camkit.models_def.optics.prescription import (
    Lens,
    Surface,
    format_prescription,
    parse_prescription,
)
from camkit.models_def.optics.reverse import launch_with_slopes, trace_to_scene
from camkit.models_def.optics.scaling import scale_lens
from camkit.models_def.optics.shape.phase import Monomial, Phase, parse_monomials
from camkit.models_def.optics.trace import Fate, Rays, surface_tensors, trace

F0_MM, WAVE0_UM, RADIUS_MM = 80.0, 0.55, 5.0
QUADRATIC = Phase(
    radius_mm=RADIUS_MM, radial_rad=(-math.pi * RADIUS_MM**2 / (WAVE0_UM * 1e-3 * F0_MM),)
)
WAVES = (0.45, 0.55, 0.65)


def _plate(phase: Phase, **numbers: object) -> Lens:
    plate = Surface(curvature_per_mm=0.0, thickness_mm=F0_MM, phase=phase, **numbers)  # type: ignore[arg-type]
    return Lens(
        name="plate",
        surfaces=(plate,),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=10.0,
        wavelengths_um=WAVES,
        reference_wavelength_um=WAVE0_UM,
    )


def _rays(x: Tensor, y: Tensor, slope: float = 0.0) -> Rays:
    n = torch.full_like(x, 1 / math.sqrt(1 + slope**2))
    fate = torch.zeros(x.shape, dtype=torch.int8)
    return Rays(x=x, y=y, z=0 * x, l=0 * x, m=slope * n, n=n, fate=fate)


@pytest.mark.parametrize("wave", WAVES)
@pytest.mark.parametrize("order", [1.0, 2.0, -1.0])
def test_quadratic_phase_focuses_each_wavelength_at_its_own_place(
    wave: float, order: float
) -> None:
    """f = f0 w0 / (M w): the dispersion of any diffractive lens, V = -3.45 in the visible."""
    lens = _plate(replace(QUADRATIC, order=order))
    wanted = F0_MM * WAVE0_UM / wave / order
    assert paraxial_data(lens, wave).efl_mm == pytest.approx(wanted, rel=1e-12)
    near = torch.tensor([1e-4], dtype=torch.float64)
    end = trace(
        surface_tensors(lens, torch.tensor(wave, dtype=torch.float64)), _rays(0 * near, near)
    )
    assert float(end.y / near) == pytest.approx(1 - F0_MM / wanted, abs=1e-8)
    near_lens = replace(lens, object_distance_mm=300.0)
    image = paraxial_image(near_lens, wave).distance_mm
    assert 1 / image == pytest.approx(1 / wanted - 1 / 300, rel=1e-9)


@pytest.mark.parametrize("wave", WAVES)
def test_phase_of_an_ideal_lens_has_equal_paths_to_the_focus(wave: float) -> None:
    """phi = -2 pi / w0 (sqrt(r^2 + f^2) - f) by its series: at w0 every ray meets the focus."""
    terms, binomial = [], 1.0
    for j in range(1, 13):
        binomial *= (0.5 - (j - 1)) / j
        length = F0_MM * binomial * (RADIUS_MM / F0_MM) ** (2 * j)
        terms.append(-2 * math.pi * length / (WAVE0_UM * 1e-3))
    lens = _plate(Phase(radius_mm=RADIUS_MM, radial_rad=tuple(terms)))
    r = torch.linspace(0, 5, 11, dtype=torch.float64)
    rays = _rays(0.6 * r, 0.8 * r)
    end = trace(surface_tensors(lens, torch.tensor(wave, dtype=torch.float64)), rays, path=True)
    assert end.path_mm is not None
    if wave == WAVE0_UM:
        assert float(torch.hypot(end.x, end.y).max()) < 1e-10
        assert float((end.path_mm - F0_MM).abs().max()) < 1e-10
    else:
        assert float(torch.hypot(end.x, end.y).max()) > 0.1


def test_linear_phase_is_a_grating() -> None:
    """n' sin b = n sin a + M w / period, on the way into glass too; no order beyond 90 degrees."""
    period_mm = 0.004
    phase = Phase(radius_mm=1.0, free_rad=parse_monomials({"y": 2 * math.pi / period_mm}))
    lens = _plate(phase, glass="N-BK7")
    tensors = surface_tensors(lens, torch.tensor(0.55, dtype=torch.float64))
    y = torch.tensor([0.0, 1.0, -3.0], dtype=torch.float64)
    end = trace(tensors, _rays(0 * y, y, slope=0.2))
    sine = 0.2 / math.sqrt(1.04) + 0.55e-3 / period_mm
    assert end.m.tolist() == pytest.approx([sine / float(tensors.index[1])] * 3, rel=1e-13)
    steep = _plate(replace(phase, order=8.0))
    lost = trace(surface_tensors(steep, torch.tensor(0.55, dtype=torch.float64)), _rays(0 * y, y))
    assert set(lost.fate.tolist()) == {Fate.TOTAL_REFLECTION}


def test_rays_are_those_of_optiland() -> None:
    """optiland 0.6.3: RadialPhaseProfile behind a sphere, four rays at 5 degrees, two waves."""
    phase = Phase(radius_mm=5.0, radial_rad=(-80.0, 6.0))
    surfaces = (
        Surface(curvature_per_mm=0, thickness_mm=2.0),
        Surface(curvature_per_mm=1 / 60, thickness_mm=6.0),
        Surface(curvature_per_mm=0, thickness_mm=45.0, phase=phase),
    )
    lens = replace(_plate(phase), surfaces=surfaces)
    x = torch.tensor([0.0, 0.0, 3.0, -2.0], dtype=torch.float64)
    y = torch.tensor([4.0, -5.0, 1.0, 2.5], dtype=torch.float64)
    landings = {
        0.45: (
            [0, 0, 1.710666149139, -1.140599929714],
            [6.652074541862, 1.539196137307, 4.946693020510, 5.797690263516],
            [55.992932320, 56.318416835, 56.123735836, 56.065114762],
        ),
        0.65: (
            [0, 0, 1.685695320279, -1.124174796522],
            [6.616346536238, 1.575227670307, 4.933859342967, 5.772620624916],
            [55.989303183, 56.321288587, 56.122371538, 56.062610532],
        ),
    }
    for wave, (wanted_x, wanted_y, path) in landings.items():
        tensors = surface_tensors(lens, torch.tensor(wave, dtype=torch.float64))
        tensors = replace(tensors, index=torch.tensor([1, 1, 1.5, 1.0], dtype=torch.float64))
        end = trace(tensors, _rays(x, y, slope=math.tan(math.radians(5))), path=True)
        assert end.path_mm is not None
        assert end.x.tolist() == pytest.approx(wanted_x, abs=1e-11)
        assert end.y.tolist() == pytest.approx(wanted_y, abs=1e-11)
        assert end.path_mm.tolist() == pytest.approx(path, abs=1e-8)


def test_free_terms_make_the_radial_one() -> None:
    free = Phase(radius_mm=RADIUS_MM, free_rad=parse_monomials({"x2": -70.0, "y2": -70.0}))
    round_one = Phase(radius_mm=RADIUS_MM, radial_rad=(-70.0,))
    x = torch.tensor([1.0, -2.0, 0.5], dtype=torch.float64)
    ends = []
    for phase in (free, round_one):
        lens = _plate(phase)
        tensors = surface_tensors(lens, torch.tensor(0.5, dtype=torch.float64))
        ends.append(trace(tensors, _rays(x, 2 * x, 0.1), path=True))
        assert paraxial_data(lens).efl_mm == pytest.approx(
            math.pi * RADIUS_MM**2 / (70 * WAVE0_UM * 1e-3)
        )
    for name in ("x", "y", "path_mm"):
        assert getattr(ends[0], name).tolist() == pytest.approx(
            getattr(ends[1], name).tolist(), rel=1e-12
        )


def test_light_goes_back_the_way_it_came() -> None:
    lens = replace(_plate(QUADRATIC), object_distance_mm=500.0)
    tensors = surface_tensors(lens, torch.tensor(0.6, dtype=torch.float64))
    y = torch.tensor([1.0, -2.0, 3.0], dtype=torch.float64)
    end = trace(tensors, _rays(0 * y, y, slope=0.05))
    back = trace_to_scene(
        tensors, launch_with_slopes(end.x, end.y, -end.l / end.n, -end.m / end.n), 500.0
    )
    assert back.y.tolist() == pytest.approx((y - 0.05 * 500.0).tolist(), rel=1e-12)


def test_rays_are_aimed_through_a_phase_in_front_of_the_stop() -> None:
    surfaces = (
        Surface(curvature_per_mm=0.01, thickness_mm=4.0, glass="N-BK7", phase=QUADRATIC),
        Surface(curvature_per_mm=0.0, thickness_mm=3.0),
        Surface(curvature_per_mm=0.0, thickness_mm=40.0),
    )
    lens = replace(_plate(QUADRATIC), surfaces=surfaces, stop=2)
    tensors = surface_tensors(lens, torch.tensor(0.6, dtype=torch.float64))
    zero = torch.zeros(1, dtype=torch.float64)
    found = aim(lens, tensors, (zero, zero), zero + 0.2)
    assert float(found.weight) > 0
    end = trace(tensors, _rays(found.x, found.y, 0.2), surfaces=range(2))
    assert float(torch.hypot(end.x, end.y)) < 1e-8


def test_larger_lens_bends_alike() -> None:
    lens = _plate(QUADRATIC)
    assert paraxial_data(scale_lens(lens, 3.0)).efl_mm == pytest.approx(3 * F0_MM)


def test_phase_comes_back_from_toml() -> None:
    phase = Phase(
        radius_mm=5.0,
        radial_rad=(-70.0, 3.0),
        free_rad=(
            Monomial(p=3, q=0, coefficient_rad=20.0),
            Monomial(p=0, q=3, coefficient_rad=20.0),
            Monomial(p=2, q=1, coefficient_rad=-1.5),
        ),
        order=2.0,
    )
    lens = _plate(phase)
    text = format_prescription(lens)
    assert "phase_free_rad = { x3 = 20.0, y3 = 20.0, x2y = -1.5 }" in text
    assert parse_prescription(text) == lens


def test_third_order_sums_of_a_phase_are_said_to_be_missing() -> None:
    with pytest.raises(ContractError, match="surface 0 has odd aspheric terms or a phase"):
        seidel_sums(_plate(QUADRATIC))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("phase_radial_rad = [1.0]", "needs phase_radius_mm"),
        ("phase_radius_mm = 2.0", "a phase without"),
        ("phase_radius_mm = 2.0\nphase_free_rad = { z3 = 1.0 }", "is named x3"),
        ("phase_radius_mm = 2.0\nphase_free_rad = { x30 = 1.0 }", "powers 1..20"),
        ('phase_radius_mm = 2.0\nphase_free_rad = { x3 = "a" }', "must be a number"),
        ("phase_radius_mm = -2.0\nphase_radial_rad = [1.0]", "> 0"),
        ("phase_radius_mm = 2.0\nphase_free_rad = { xy = 1.0, x1y1 = 1.0 }", "twice"),
    ],
)
def test_wrong_phases_are_refused(change: str, message: str) -> None:
    text = format_prescription(_plate(QUADRATIC))
    lines = [line for line in text.splitlines() if not line.startswith("phase_")]
    with pytest.raises(ContractError, match=message):
        parse_prescription("\n".join([*lines, change]))
