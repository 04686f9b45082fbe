"""Recipes of thin plates: what they say and what they refuse."""

from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.thin.thin_recipe import find_thin_recipe, read_thin_recipe

RECIPE = Path(__file__).resolve().parents[4] / "models_def" / "recipes" / "thin_plate_lens.toml"


def test_a_groove_of_200_pi_is_a_hundred_waves_of_delay() -> None:
    """In PMMA at 0.55 um: 111.6 um, not the 120 um that the thesis prints."""
    plate = read_thin_recipe(RECIPE).plate
    assert plate.groove_depth_um * (plate.index - 1) == pytest.approx(100 * 0.55, rel=1e-12)
    assert plate.groove_depth_um == pytest.approx(111.6, abs=0.1)


def test_directions_go_from_the_axis_to_the_corner() -> None:
    angles = find_thin_recipe(Path("thin_plate_lens")).partition.field_angles_rad
    assert len(angles) == 7
    assert angles[0] == 0
    assert angles[-1] == pytest.approx(0.49916, abs=1e-4)


def test_names_that_nothing_has_are_answered_with_those_that_there_are() -> None:
    with pytest.raises(ContractError, match="no recipe is called thin-plate; there are thin_plate"):
        find_thin_recipe(Path("thin-plate"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("terms = 6", "terms = 0", "plate.terms"),
        ("efl_mm = 43.0", "efl_mm = -1.0", "plate.efl_mm must be 0.01 to 1000 mm"),
        ("thickness_mm = 10.0", "thickness_mm = 1e300", "plate.thickness_mm must be 0.01 to"),
        ("aperture_mm = 23.4", "aperture_mm = 1e9", "plate.aperture_mm must be 0.01 to"),
        ("radius_mm = 4.5", "radius_mm = 1e-300", "partition.radius_mm must be 0.01 to"),
        ('"PMMA-Sultanova2009"', '"air"', "glass must bend light; got air"),
        ("efl_mm = 43.0", "", "lacks efl_mm"),
        ('faces = "both"', 'faces = "all"', "one of both, front, back"),
        ("radius_mm = 4.5", "radius_mm = 14.5", "does not fit"),
        ("corner_deg = 28.6", "corner_deg = 88.0", "0..80"),
        ("1.5, 2.0]", "1.5]", "needs 7 numbers"),
        ("1.5, 2.0]", "1.5, 0.0]", "weights must be > 0"),
        ("directions = 7", "directions = 1", "2..50"),
        ("[partition]", "[partitions]", "unknown key 'partitions'"),
        ("terms = 6", "tool_radius_um = -1.0", "tool_radius_um must be >= 0"),
        ("[plate]", "[solver]\nsteps = 0\n[plate]", "solver.steps"),
    ],
)
def test_wrong_recipes_say_what_is_wrong(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "r.toml"
    text = RECIPE.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ContractError, match=words):
        read_thin_recipe(path)


def test_a_recipe_without_its_tables_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "r.toml"
    path.write_text('name = "x"\n')
    with pytest.raises(ContractError, match="lacks plate, partition"):
        read_thin_recipe(path)
