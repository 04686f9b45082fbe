from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from camkit.errors import ContractError
from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.recipe import read_design, recipe_digest, to_design, with_choices

RECIPES = Path(__file__).resolve().parents[3] / "models_def" / "recipes"


@pytest.mark.parametrize("name", ["duet_joint"])
def test_recipes_that_are_shipped_can_be_run(name: str) -> None:
    parts = parts_of(read_design(RECIPES / f"{name}.toml"), folder=RECIPES)
    kernels, penalty = parts.lens()
    assert kernels.shape[2] == 3
    assert float(penalty.detach()) < 0.1


def change(key: str, **entries: Any) -> Callable[[dict[str, Any]], None]:
    return lambda table: table.__setitem__(key, {**table[key], **entries})


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda t: t.pop("optics"), "lacks optics"),
        (lambda t: t.__setitem__("lens", {}), "unknown key 'lens'"),
        (lambda t: t.__setitem__("vary", {}), r"\[\[vary\]\]"),
        (lambda t: t["vary"][0].__setitem__("kind", "colour"), "one of"),
        (change("front", kind="magic"), "one of none, wiener"),
        (change("loss", kind="l7"), "one of"),
        (change("network", name="resnet"), "network must be one of"),
        (change("schedule", steps=0), "must be >= 1"),
        (change("schedule", lens_rate="fast"), "type float"),
        (change("pixels", kernel_px=32), "odd"),
        (change("pixels", wavelengths_um=[0.5]), "three rows"),
        (change("optics", half_field_deg=95.0), "half_field_deg"),
        (lambda t: t.__setitem__("prescription", "nowhere"), "no lens 'nowhere'"),
        (change("front", kind="wiener"), "takes 3 planes"),
    ],
)
def test_wrong_recipes_are_refused_with_a_reason(
    spoil: Callable[[dict[str, Any]], object], message: str, table: dict[str, Any]
) -> None:
    spoil(table)
    with pytest.raises(ContractError, match=message):
        parts_of(to_design(table))


def test_choices_of_a_caller_win_and_change_the_digest(table: dict[str, Any]) -> None:
    recipe = to_design(table)
    changed = with_choices(recipe, steps=9, lens_rate=0.0, seed=4, prescription="cooke-triplet")
    assert (changed.schedule.steps, changed.schedule.lens_rate) == (9, 0.0)
    assert (changed.schedule.seed, changed.prescription) == (4, "cooke-triplet")
    assert recipe_digest(changed) != recipe_digest(recipe)
    assert recipe_digest(with_choices(recipe)) == recipe_digest(recipe)
