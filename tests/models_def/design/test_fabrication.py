"""Copies in a design against fabricated copies of the prescription, number by number."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.design_recipe import DesignRecipe, NetworkChoice, read_design
from camkit.models_def.design.fabrication import Copy, draw_copy, made_with
from camkit.models_def.design.loop import DesignLoop, DesignParts
from camkit.models_def.design.starts import Starts
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.problem import trace_batch
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors

RECIPE = Path(__file__).resolve().parents[3] / "models_def" / "recipes" / "duet_joint_lens.toml"
ERRORS = FabricationErrors()


def given() -> DesignRecipe:
    """Give the recipe without its search: its lens is as good as any here."""
    return replace(read_design(RECIPE), starts=Starts())


@pytest.fixture(scope="module")
def parts() -> DesignParts:
    recipe = given()
    small = replace(recipe.pixels, kernel_px=65, cfa="")
    optics = replace(recipe.optics, fields=3, pupil_rays=64)
    schedule = replace(recipe.schedule, steps=2, batch=2, patch_px=24, valid_patches=2)
    front = replace(recipe.front, filter_margin_px=8)
    return parts_of(
        replace(
            recipe,
            pixels=small,
            optics=optics,
            schedule=schedule,
            front=front,
            network=NetworkChoice(config={}),
            fabrication=ERRORS,
        )
    )


def as_made(lens: Lens, copy: Copy) -> Lens:
    """Give the copy as a prescription, each number by itself; glass stays."""
    surfaces = [
        replace(s, curvature_per_mm=s.curvature_per_mm / (1 + r), thickness_mm=s.thickness_mm + t)
        for s, r, t in zip(lens.surfaces, copy.radius, copy.thickness_mm, strict=True)
    ]
    made = replace(lens, surfaces=tuple(surfaces))
    shift = paraxial_data(made).bfl_mm - paraxial_data(lens).bfl_mm + copy.focus_mm
    last = replace(surfaces[-1], thickness_mm=surfaces[-1].thickness_mm + shift)
    return replace(made, surfaces=(*surfaces[:-1], last))


def test_a_copy_is_the_prescription_with_its_errors_focused_again(parts: DesignParts) -> None:
    lens, problem = parts.lens.lens(), parts.lens.problem
    copy = replace(draw_copy(lens, ERRORS, 5), index=np.zeros(len(lens.surfaces)))
    reference = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    scaled = parts.lens.scaled().detach()[None]
    tensors = problem.free.tensors(scaled, reference)
    made = made_with(tensors, copy, reference=tensors, object_distance_mm=torch.inf)
    expected = as_made(lens, copy)
    for name in ("curvature_per_mm", "thickness_mm"):
        found = getattr(made, name).flatten().tolist()
        assert found == pytest.approx([getattr(s, name) for s in expected.surfaces], rel=1e-9)


def test_an_index_error_moves_the_focus_and_the_sensor_follows(parts: DesignParts) -> None:
    lens, problem = parts.lens.lens(), parts.lens.problem
    none = np.zeros(len(lens.surfaces))
    copy = Copy(radius=none, thickness_mm=none, index=none.copy(), focus_mm=0.0)
    copy.index[1] = 5e-3
    reference = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    tensors = problem.free.tensors(parts.lens.scaled().detach()[None], reference)
    made = made_with(tensors, copy, reference=tensors, object_distance_mm=torch.inf)
    assert float(made.index[2] - tensors.index[2]) == pytest.approx(5e-3)
    assert torch.equal(made.index[1], tensors.index[1])
    moved = float(made.thickness_mm[-1] - tensors.thickness_mm[-1])
    assert abs(moved) > 0.05


def test_copies_differ_by_number_stay_within_their_errors_and_air_has_none() -> None:
    lens = parts_of(given()).lens.lens()
    one, again, other = (draw_copy(lens, ERRORS, n) for n in (1, 1, 2))
    assert np.array_equal(one.radius, again.radius)
    assert not np.array_equal(one.radius, other.radius)
    assert np.abs(one.radius).max() <= ERRORS.radius_relative + 1e-12
    assert np.abs(one.index).max() <= ERRORS.index
    assert one.thickness_mm[-1] == 0
    assert [bool(i) for i in one.index != 0] == [s.glass != "air" for s in lens.surfaces]


def test_captures_come_through_copies_and_gradients_reach_the_lens(parts: DesignParts) -> None:
    lens = parts.lens
    kernels, _ = lens()
    made = lens.made_kernels(draw_copy(lens.lens(), ERRORS, 3))
    assert made.shape == kernels.shape
    assert float((made - kernels).detach().abs().sum((-2, -1)).max()) > 0.05
    made.square().sum().backward()  # type: ignore[no-untyped-call]
    assert lens.moves.grad is not None
    assert bool((lens.moves.grad != 0).any())
    loop = DesignLoop(parts, given().schedule)
    with_copies = loop.judge().valid_db
    without = DesignLoop(replace(parts, fabrication=None), loop.schedule).judge().valid_db
    assert with_copies != without


def test_without_a_change_a_batch_is_traced_as_it_is(parts: DesignParts) -> None:
    problem, scaled = parts.lens.problem, parts.lens.scaled().detach()[None]
    plain = trace_batch(problem, scaled, torch.inf).landings.y
    same = trace_batch(problem, scaled, torch.inf, lambda tensors, _reference: tensors).landings.y
    assert torch.equal(plain, same)
