import math
from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import (
    entrance_pupil,
    image_distance,
    paraxial_data,
    paraxial_image,
)
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.improvement import improve
from camkit.models_def.optics.search.limits import Limits
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.variables import FreeLens, Parameter, Variable
from camkit.models_def.optics.shape.phase import Phase
from camkit.models_def.optics.trace import surface_tensors

WAVES_UM = torch.tensor([0.48, 0.55, 0.65], dtype=torch.float64)


def test_a_lens_made_of_its_own_numbers_is_that_lens(free: FreeLens, lens: Lens) -> None:
    unsolved = FreeLens(lens=lens, variables=free.variables)
    for one, other in zip(unsolved.lens_at(unsolved.scaled()).surfaces, lens.surfaces, strict=True):
        assert one.curvature_per_mm == pytest.approx(other.curvature_per_mm, rel=1e-12)
        assert one.thickness_mm == pytest.approx(other.thickness_mm, rel=1e-12)
        assert one.conic == pytest.approx(other.conic, abs=1e-12)


def test_numbers_of_the_lens_outside_their_bounds_are_named(lens: Lens) -> None:
    bounds = {"low": 0.5, "high": 0.6}
    flat = Variable(kind="curvature", surface=1, **bounds)
    inside = Variable(kind="conic", surface=1, low=-50.0, high=50.0)
    free = FreeLens(lens=lens, variables=(flat, inside), rides=False)
    assert free.outside() == ((flat, lens.surfaces[1].curvature_per_mm),)


@pytest.fixture
def shaped(lens: Lens) -> FreeLens:
    """A lens with every kind of free coefficient."""
    front, back, flint, *rest = lens.surfaces
    surfaces = (
        replace(front, q_con=(0.02, -0.01), normal_radius_mm=8.0),
        replace(back, q_bfs=(0.01, 0.005, -0.002), normal_radius_mm=8.0),
        replace(flint, phase=Phase(radius_mm=6.0, radial_rad=(-30.0, 4.0))),
        *rest,
    )
    return FreeLens(
        lens=replace(lens, surfaces=surfaces),
        variables=(
            Variable(kind="q_asphere", surface=0, term=2, low=-0.01, high=0.01),
            Variable(kind="q_asphere", surface=1, term=1, low=0.0, high=0.01),
            Variable(kind="phase", surface=2, term=0, low=-100.0, high=0.0),
            Variable(kind="odd_asphere", surface=3, term=1, low=-1e-5, high=1e-5),
            Variable(kind="even_asphere", surface=4, term=1, low=-1e-6, high=1e-6),
        ),
        solved=5,
        efl_mm=50.0,
    )


def test_coefficients_of_every_shape_are_free(shaped: FreeLens) -> None:
    """A batch is its prescriptions, with their focal length; numbers have their slopes."""
    batch = torch.tensor(
        [[0.3, 0.4, 0.2, 0.7, 0.6], [0.5, 0.5, 0.5, 0.6, 0.5]], dtype=torch.float64
    )
    together = shaped.tensors(batch.requires_grad_(), WAVES_UM)
    rho = torch.tensor([1.0, 16.0], dtype=torch.float64)
    for i, scaled in enumerate(batch):
        made = shaped.lens_at(scaled)
        assert paraxial_data(made).efl_mm == pytest.approx(50.0, rel=1e-10)
        alone = surface_tensors(made, WAVES_UM)
        assert alone.series == together.series
        for surface in range(6):
            height = together.height(surface, rho)[i, 0, 0]
            torch.testing.assert_close(height.detach(), alone.height(surface, rho))
        assert together.phase is not None
        assert alone.phase is not None
        torch.testing.assert_close(together.phase[:, :, i, 0, 0, 0].detach(), alone.phase)
    height = together.height(0, rho)[0, 0, 0]
    (slope,) = torch.autograd.grad(height[1], batch)
    t = 16 / 64
    # the range of the first variable times u^4 Q_con 2
    assert float(slope[0, 0]) == pytest.approx(0.02 * t**2 * (15 - 14 * t * (3 - 2 * t)))
    assert shaped.lens_at(batch[1].detach()).surfaces[0].q_con[:2] == (0.02, -0.01)


def test_least_squares_focus_a_diffractive_lens(lens: Lens) -> None:
    """The free first coefficient becomes that of an ideal lens: -2 pi / w (r^2/2f - r^4/8f^3)."""
    wave_mm, focal_mm = 0.55e-3, 80.0
    wanted = -math.pi * 25 / (wave_mm * focal_mm)
    fourth = math.pi * 625 / (4 * wave_mm * focal_mm**3)
    phase = Phase(radius_mm=5.0, radial_rad=(-1780.0, fourth))
    stop = Surface(curvature_per_mm=0.0, thickness_mm=1.0)
    plate = Surface(curvature_per_mm=0.0, thickness_mm=focal_mm, phase=phase)
    begin = replace(lens, surfaces=(stop, plate), stop=0)
    free = FreeLens(
        lens=begin,
        variables=(Variable(kind="phase", surface=1, term=0, low=-3000.0, high=0.0),),
        rides=False,
    )
    problem = Problem(
        free=free,
        slopes=torch.zeros(1, dtype=torch.float64),
        wavelengths_um=torch.tensor([0.55], dtype=torch.float64),
        samples=half_disc(30),
        limits=Limits(),
    )
    end = free.lens_at(improve(problem, free.scaled()).scaled)
    found = end.surfaces[1].phase
    assert found is not None
    assert found.radial_rad == pytest.approx((wanted, fourth), rel=1e-4)


@pytest.mark.parametrize(
    ("kind", "surface", "term"),
    [("q_asphere", 3, 0), ("even_asphere", 0, 1), ("odd_asphere", 1, 1), ("phase", 2, 2)],
)
def test_terms_that_a_surface_cannot_have_are_refused(
    shaped: FreeLens, kind: Parameter, surface: int, term: int
) -> None:
    variable = Variable(kind=kind, surface=surface, term=term, low=0.0, high=1.0)
    with pytest.raises(ContractError, match=f"surface {surface} has no such term"):
        replace(shaped, variables=(variable,))


def test_every_lens_keeps_the_focal_length_and_rides_on_its_image(free: FreeLens) -> None:
    generator = torch.Generator().manual_seed(3)
    for _ in range(4):
        scaled = torch.rand(len(free.variables), generator=generator, dtype=torch.float64)
        scaled[-1] = 0.5  # no defocus
        made = free.lens_at(scaled)
        data = paraxial_data(made)
        assert data.efl_mm == pytest.approx(50.0, rel=1e-10)
        # the lens began out of focus: what it rides on is the image plus that
        offset = made.surfaces[-1].thickness_mm - data.bfl_mm
        assert offset == pytest.approx(0.0, abs=1e-9)


def test_a_batch_equals_its_lenses_one_by_one(free: FreeLens) -> None:
    generator = torch.Generator().manual_seed(5)
    batch = torch.rand(3, len(free.variables), generator=generator, dtype=torch.float64)
    together = free.tensors(batch, WAVES_UM)
    for i, scaled in enumerate(batch):
        alone = surface_tensors(free.lens_at(scaled), WAVES_UM)
        for name in ("curvature_per_mm", "conic", "thickness_mm"):
            found = getattr(together, name)[:, i, 0, 0, 0]
            torch.testing.assert_close(found, getattr(alone, name), rtol=1e-12, atol=1e-12)


def test_the_image_of_a_near_object_is_the_paraxial_one(lens: Lens) -> None:
    near = replace(lens, object_distance_mm=400.0)
    wave = torch.tensor(0.55, dtype=torch.float64)
    found = image_distance(surface_tensors(near, wave), 400.0)
    assert float(found) == pytest.approx(paraxial_image(near).distance_mm, rel=1e-12)


def test_the_entrance_pupil_of_a_batch_is_that_of_paraxial_data(lens: Lens) -> None:
    wave = torch.tensor(0.55, dtype=torch.float64)
    place, scale = entrance_pupil(surface_tensors(lens, wave), lens.stop)
    data = paraxial_data(lens)
    assert float(place) == pytest.approx(data.entrance_pupil_mm, rel=1e-10)
    wanted = data.entrance_pupil_diameter_mm / 2 / data.stop_semi_diameter_mm
    assert abs(float(scale)) == pytest.approx(wanted, rel=1e-10)


def test_gradients_reach_every_free_number(problem: Problem) -> None:
    from camkit.models_def.optics.search.problem import residuals

    scaled = problem.free.scaled()[None].requires_grad_()
    residuals(problem, scaled).square().sum().backward()  # type: ignore[no-untyped-call]
    assert scaled.grad is not None
    assert bool(torch.isfinite(scaled.grad).all())
    assert bool((scaled.grad != 0).all())


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ((Variable(kind="curvature", surface=9, low=0, high=1),), r"has 6 surfaces, 0\.\.5"),
        (
            (Variable(kind="conic", surface=1, low=0, high=1),) * 2,
            "surface 1, term 0, is listed twice",
        ),
        ((Variable(kind="curvature", surface=5, low=0, high=1),), "is solved"),
        ((Variable(kind="thickness", surface=5, low=0, high=1),), "rides"),
    ],
)
def test_numbers_that_undo_each_other_are_refused(
    variables: tuple[Variable, ...], message: str, lens: Lens
) -> None:
    with pytest.raises(ContractError, match=message):
        FreeLens(lens=lens, variables=variables, solved=5, efl_mm=50.0)


def test_bounds_must_be_in_order() -> None:
    with pytest.raises(ContractError, match="low must be <= high, both finite; got low = 1,"):
        Variable(kind="conic", low=1, high=0)
