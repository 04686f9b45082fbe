"""A lens with several configurations is designed in all of them at once."""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.design_recipe import DesignRecipe, recipe_digest, to_design
from camkit.models_def.design.lens_module import LensModule
from camkit.models_def.design.loop import DesignLoop
from camkit.models_def.design.run import DesignOptions, DesignRun
from camkit.models_def.design.states_module import StatesModule
from camkit.models_def.optics.lens_file.lens_file import find_lens, read_configured_lens
from camkit.models_def.optics.lens_file.states import plain_lens
from camkit.models_def.optics.spot import chief_heights
from tests.tiny_design import RECIPE

PRESCRIPTIONS = Path(__file__).resolve().parents[3] / "models_def" / "prescriptions"
STATES = """
[[configuration]]
name = "far"

[[configuration]]
name = "near"
thickness_mm = { 5 = 43.5 }
object_distance_mm = 2000.0
"""
VARY = [
    {"kind": "curvature", "surface": 1, "low": -0.1, "high": 0.1},
    {"kind": "thickness", "surface": 5, "low": 40, "high": 46, "configuration": "far"},
    {"kind": "thickness", "surface": 5, "low": 40, "high": 46, "configuration": "near"},
]


@pytest.fixture(name="recipe")
def fixture_recipe(tmp_path: Path) -> DesignRecipe:
    lens = (PRESCRIPTIONS / "cooke-triplet.toml").read_text() + STATES
    (tmp_path / "focusing.toml").write_text(lens)
    return to_design(_table(vary=VARY))


def _table(vary: list[dict[str, Any]], **optics: Any) -> dict[str, Any]:
    table = tomllib.loads(RECIPE)
    states = {"configurations": ["all"], "rides": False, "psf_model": "rays"}
    plain = {"half_field_deg": 12.0, "fields": 2, "pupil_rays": 24}
    return table | {
        "prescription": "focusing.toml",
        "vary": vary,
        "optics": plain | states | optics,
    }


def test_kernels_of_each_state_are_those_of_its_lens(recipe: DesignRecipe, tmp_path: Path) -> None:
    lens = parts_of(recipe, folder=tmp_path).lens
    assert isinstance(lens, StatesModule)
    kernels, penalty = lens()
    corners_mm = []
    assert (lens.depth_count, kernels.shape) == (2, (2, 2, 3, 33, 33))
    for term, of_state in zip(lens.joint.terms, kernels, strict=True):
        begin = term.problem.free.scaled()
        alone = LensModule(term.problem, lens.pixels, begin, whiten=False)
        torch.testing.assert_close(of_state, alone()[0][0])
        plain = term.problem.free.lens_at(begin)
        corners_mm.append(float(chief_heights(plain, term.problem.slopes[1:])[0]))
    # the same place of the sensor, but for distortion, also for an object that is near
    assert corners_mm[1] == pytest.approx(corners_mm[0], rel=0.01)
    assert float(penalty.detach()) >= 0


def test_every_number_feels_the_pictures_of_its_states(
    recipe: DesignRecipe, tmp_path: Path
) -> None:
    plain = replace(recipe, optics=replace(recipe.optics, whiten=False))
    lens = parts_of(plain, folder=tmp_path).lens
    kernels, _ = lens()
    for state, expected in ((0, [True, True, False]), (1, [True, False, True])):
        sharpness = kernels[state].square().sum()
        (slope,) = torch.autograd.grad(sharpness, lens.moves, retain_graph=True)
        assert (slope != 0).tolist() == expected
    with torch.no_grad():
        lens.moves[0] = 0.01
    # the focal lengths changed, and that costs
    assert float(lens()[1].detach()) > 1e-4


def test_a_run_writes_a_lens_with_all_states(recipe: DesignRecipe, tmp_path: Path) -> None:
    options = DesignOptions(out_dir=tmp_path / "run", recipe_folder=tmp_path)
    run = DesignRun(recipe, options)
    assert [moment.step for moment in run.go()][-1] == 2
    report = run.finish()
    lens = read_configured_lens(Path(report["lens"]))[0]
    assert [state.name for state in lens.configurations] == ["far", "near"]
    begin = find_lens("focusing.toml", tmp_path, with_states=True)
    for name in ("far", "near"):
        gaps = [plain_lens(one, name).surfaces[5].thickness_mm for one in (begin, lens)]
        assert gaps[1] == pytest.approx(gaps[0], abs=0.5)
    assert all(surface.semi_diameter_mm < 20 for surface in lens.surfaces)
    assert run.view().lens.configurations == ()


def test_the_loss_is_of_all_states(recipe: DesignRecipe, tmp_path: Path) -> None:
    """Worse focus of one state costs, though the other is as it was."""
    merits = []
    for gap_mm in (43.5, 44.2):
        text = (tmp_path / "focusing.toml").read_text().replace("43.5", str(gap_mm))
        (tmp_path / "focusing.toml").write_text(text)
        loop = DesignLoop(parts_of(recipe, folder=tmp_path), recipe.schedule)
        loop.judge()
        merits.append(loop.best_merit)
    assert merits[1] < merits[0] - 0.5


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"optics": {"rides": True}}, "leave rides out"),
        ({"optics": {"efl_mm": 50.0}}, "leave efl_mm out"),
        ({"optics": {"object_distances_mm": [900.0]}}, "leave object_distances_mm out"),
        ({"optics": {"configurations": []}}, "vary.configuration needs optics.configurations"),
        ({"starts": {"count": 4}}, "leave starts, descent out"),
        ({"front": {"kind": "wiener", "depth_known": False}}, "set depth_known"),
    ],
)
def test_what_does_not_go_with_states_is_refused(changes: dict[str, Any], message: str) -> None:
    table = _table(vary=VARY, **changes.pop("optics", {})) | changes
    with pytest.raises(ContractError, match=message):
        to_design(table)


@pytest.mark.parametrize(
    ("variable", "message"),
    [
        ({"kind": "thickness", "surface": 5}, "is free in far, near; got 'none'"),
        ({"kind": "thickness", "surface": 5, "configuration": "tele"}, "far, near; got 'tele'"),
        ({"kind": "conic", "surface": 1, "configuration": "near"}, "conic is free in no conf"),
    ],
)
def test_a_variable_is_shared_or_of_a_state(
    variable: dict[str, Any], message: str, recipe: DesignRecipe, tmp_path: Path
) -> None:
    other = to_design(_table(vary=[{**variable, "low": 0.0, "high": 50.0}]))
    with pytest.raises(ContractError, match=message):
        parts_of(other, folder=tmp_path)
    assert recipe_digest(other) != recipe_digest(recipe)


def test_designs_of_one_state_go_on() -> None:
    """Their recipes have the digest that they had before there were configurations."""
    assert recipe_digest(to_design(tomllib.loads(RECIPE))) == (
        "dda41a3747aa2cce3e0603f3ecc14cc79701cbc2e071d3456b5f06e2c18eaea2"
    )
