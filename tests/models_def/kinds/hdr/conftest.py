"""A snapshot HDR camera so small that a step of its network takes no second."""

import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from camkit.models_def.kinds.hdr.material import HdrMaterial
from camkit.models_def.kinds.hdr.recipe import HdrRecipe, to_hdr_recipe
from camkit.models_def.kinds.hdr.samples import HdrCamera
from tests.changed_table import Table, changed_table
from tests.hdr_bundle import four_lines
from tests.hdr_recipe import small_recipe

SHIPPED = Path(__file__).resolve().parents[4] / "models_def" / "recipes" / "streak_hdr.toml"


@pytest.fixture(scope="session")
def tiny_text() -> str:
    """The shipped camera with small samples and a small network."""
    return small_recipe(SHIPPED, "S", "bias = true")


@pytest.fixture
def changed(tiny_text: str) -> Callable[..., Table]:
    """Give the table of the tiny recipe, changed as `changed_table` says."""
    return partial(changed_table, tiny_text)


@pytest.fixture(scope="session")
def tiny(tiny_text: str) -> HdrRecipe:
    return to_hdr_recipe(tomllib.loads(tiny_text))


@pytest.fixture(scope="session")
def lines() -> HdrMaterial:
    """Four lines about every light, of the fixture of bundles."""
    return HdrMaterial(streaks=four_lines())


@pytest.fixture(scope="session")
def camera(tiny: HdrRecipe, lines: HdrMaterial) -> HdrCamera:
    return HdrCamera(tiny, lines)
