"""Recipes of plates: those that are shipped can begin, wrong ones are one error."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from camkit.errors import ContractError
from camkit.models_def.design.plate.plate_recipe import (
    plate_recipe_digest,
    read_plate_recipe,
    to_plate_recipe,
    with_plate_choices,
)

RECIPES = Path(__file__).resolve().parents[4] / "models_def" / "recipes"
# `thin_plate` is a camera; its lens is a plate of another kind
PLATES = sorted(path for path in RECIPES.glob("*_plate.toml") if path.stem != "thin_plate")


def table(**changes: Any) -> dict[str, Any]:
    """Give a small recipe of a cross."""
    return {
        "name": "small",
        "cells": 96,
        "bench": {"diameter_mm": 2.0, "focal_length_mm": 25.0, "focus_mm": 2000.0},
        "map": {"kind": "rank", "rank": 1, "offset": 1.0, "start": 0.1},
        "goal": {"near_px": 4.0, "far_px": 20.0},
        "pixels": {"pitch_um": 6.0, "side_px": 41, "wavelengths_um": [0.5, 0.6], "samples": 2},
        "schedule": {"steps": 6, "rate": 0.05, "log_steps": 2},
        **changes,
    }


@pytest.mark.parametrize("path", PLATES, ids=lambda path: path.stem)
def test_recipes_that_are_shipped_are_sound(path: Path) -> None:
    recipe = read_plate_recipe(path)
    assert recipe.name == path.stem.removesuffix("_plate").replace("_", "-")
    assert recipe.goal.far_px <= recipe.pixels.side_px // 2


def test_choices_replace_what_the_recipe_says() -> None:
    recipe = to_plate_recipe(table())
    assert with_plate_choices(recipe) == recipe
    chosen = with_plate_choices(recipe, steps=9, seed=4)
    assert (chosen.schedule.steps, chosen.schedule.seed) == (9, 4)
    assert plate_recipe_digest(chosen) != plate_recipe_digest(recipe)


def test_a_reader_decides_a_run_too_and_none_leaves_older_checkpoints_their_digest() -> None:
    alone = to_plate_recipe(table())
    read = to_plate_recipe(table(reader={"recipe": "x.toml", "size": "S"}))
    assert plate_recipe_digest(read) != plate_recipe_digest(alone)
    older = {key: value for key, value in asdict(alone).items() if key != "reader"}
    text = json.dumps(older, sort_keys=True).encode()
    assert plate_recipe_digest(alone) == hashlib.sha256(text).hexdigest()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lens": {}}, "unknown key 'lens'"),
        ({"map": {"kind": "spline"}}, r"map\.kind must be one of full, rank"),
        ({"map": {"kind": "gratings", "numbers": 9}}, "gratings need angles_deg"),
        ({"map": {"kind": "radial"}}, "radial needs numbers >= 2"),
        ({"map": {"kind": "full", "start": -1.0}}, "start must be >= 0"),
        ({"pixels": {"wavelengths_um": []}}, "wavelengths_um > 0"),
        ({"pixels": {"samples": -1}}, "samples >= 0"),
        ({"schedule": {"rate": 0.0}}, "rate > 0"),
        ({"schedule": {"steps": 0}}, "steps and log_steps >= 1"),
        ({"schedule": {"etched": True}}, r"needs a table \[etching\]"),
        ({"schedule": {"depth_error": 0.1}}, "needs etched = true"),
        ({"schedule": 3}, "schedule must be a table"),
        ({"reader": {"recipe": "x.toml"}}, "reader lacks size"),
        ({"reader": {"recipe": "x.toml", "size": "S", "batch": 0}}, "batch, patch_px, scenes"),
        ({"reader": {"recipe": "x.toml", "size": "S", "weight": -1.0}}, "weight >= 0"),
        ({"cells": "many"}, "cells must be a whole number"),
        ({"etching": {"range_um": 0.3, "levels": 1}}, "levels are 2, 4, 8"),
    ],
)
def test_wrong_recipes_are_refused_with_a_reason(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        to_plate_recipe(table(**changes))


@pytest.mark.parametrize("key", ["name", "cells", "bench", "map"])
def test_what_is_missing_is_named(key: str) -> None:
    given = table()
    del given[key]
    with pytest.raises(ContractError, match=f"lacks {key}"):
        to_plate_recipe(given)
