import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import (
    entrance_pupil,
    image_distance,
    paraxial_data,
    paraxial_image,
)
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.variables import FreeLens, Variable
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
    from dataclasses import replace

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
        ((Variable(kind="curvature", surface=9, low=0, high=1),), "surface of its own"),
        ((Variable(kind="conic", surface=1, low=0, high=1),) * 2, "surface of its own"),
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
    with pytest.raises(ContractError, match="low <= high"):
        Variable(kind="conic", low=1, high=0)
