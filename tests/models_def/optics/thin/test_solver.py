"""The solver: what it says of a plate is what the tracer says of the lens."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.errors import UnsupportedError
from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.thin.plate_lens import plate_lens
from camkit.models_def.optics.thin.solver import SolvedPlate, solve_plate
from camkit.models_def.optics.thin.thin_recipe import ThinRecipe, find_thin_recipe
from camkit.models_def.optics.trace import Rays, surface_tensors, trace, without_walls


def _recipe(name: str) -> ThinRecipe:
    return find_thin_recipe(Path(name))


@pytest.fixture(scope="module")
def solved() -> dict[str, tuple[ThinRecipe, SolvedPlate]]:
    recipes = {
        "both": _recipe("thin_plate_lens"),
        "back": _recipe("thin_plate_single_lens"),
    }
    front = replace(recipes["back"].plate, faces="front")
    recipes["front"] = replace(recipes["back"], plate=front)
    return {name: (recipe, solve_plate(recipe)) for name, recipe in recipes.items()}


def _discs(recipe: ThinRecipe, found: SolvedPlate, lens: Lens) -> Rays:
    """Trace the rays of the virtual apertures with ideal grooves, (direction, ray)."""
    tensors = surface_tensors(lens, torch.tensor(recipe.plate.wavelength_um, dtype=torch.float64))
    disc, radius = half_disc(300), found.apertures.radius_mm
    centres = torch.tensor(found.apertures.centres_mm, dtype=torch.float64)[:, None]
    slope = torch.tan(torch.tensor(found.apertures.field_angles_rad, dtype=torch.float64))
    rays = launch(disc.x * radius, disc.y * radius + centres, slope[:, None], math.inf)
    return trace(without_walls(tensors), rays)


@pytest.mark.parametrize("faces", ["both", "back", "front"])
def test_traced_spots_of_the_virtual_apertures_are_those_of_the_solver(
    solved: dict[str, tuple[ThinRecipe, SolvedPlate]], faces: str
) -> None:
    """Steps of 112 um, which the solver takes as infinitely many, move light by some um."""
    recipe, found = solved[faces]
    landed = _discs(recipe, found, plate_lens(recipe, found))
    assert bool(landed.valid.all())
    middle = landed.y.mean(-1, keepdim=True)
    rms_um = 1000 * torch.sqrt((landed.x**2 + (landed.y - middle) ** 2).mean(-1))
    assert rms_um.numpy() == pytest.approx(found.spot_rms_um, rel=0.15, abs=6)
    assert middle[:, 0].numpy() == pytest.approx(found.heights_mm, abs=0.03)


@pytest.mark.parametrize("faces", ["both", "back", "front"])
def test_the_focal_length_is_kept(
    solved: dict[str, tuple[ThinRecipe, SolvedPlate]], faces: str
) -> None:
    recipe, found = solved[faces]
    lens = plate_lens(recipe, found)
    assert paraxial_data(lens).efl_mm == pytest.approx(recipe.plate.efl_mm, rel=1e-9)
    assert (lens.surfaces[1].grooves is None) == (faces == "back")
    assert (lens.surfaces[2].grooves is None) == (faces == "front")


def test_the_second_face_is_worth_its_work(
    solved: dict[str, tuple[ThinRecipe, SolvedPlate]],
) -> None:
    assert max(solved["both"][1].spot_rms_um) < 0.7 * max(solved["back"][1].spot_rms_um)


def test_virtual_apertures_lie_within_the_plate(
    solved: dict[str, tuple[ThinRecipe, SolvedPlate]],
) -> None:
    for recipe, found in solved.values():
        room_mm = recipe.plate.aperture_mm / 2 - recipe.partition.radius_mm
        assert found.apertures.centres_mm[0] == 0
        assert all(abs(centre) <= room_mm + 1e-9 for centre in found.apertures.centres_mm)


def test_a_disc_as_wide_as_the_plate_is_solved_too() -> None:
    recipe = _recipe("thin_plate_single_lens")
    wide = replace(
        recipe,
        partition=replace(recipe.partition, radius_mm=recipe.plate.aperture_mm / 2),
        solver=replace(recipe.solver, steps=5),
    )
    assert set(solve_plate(wide).apertures.centres_mm) == {0.0}


def test_a_real_stop_stands_in_front_of_the_plate(
    solved: dict[str, tuple[ThinRecipe, SolvedPlate]],
) -> None:
    _, found = solved["both"]
    lens = plate_lens(_recipe("thin_plate_stop_lens"), found)
    assert lens.aperture_value == 3.9
    assert lens.surfaces[0].thickness_mm == 15.6
    assert lens.surfaces[1].semi_diameter_mm > 11.7


def test_a_groove_narrower_than_the_tool_is_refused(
    solved: dict[str, tuple[ThinRecipe, SolvedPlate]],
) -> None:
    recipe, found = solved["both"]
    blunt = replace(recipe, plate=replace(recipe.plate, tool_radius_um=200.0))
    with pytest.raises(UnsupportedError, match="narrower than the tool"):
        plate_lens(blunt, found)
