"""A snapshot HDR camera so small that a step of its network takes no second."""

import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch

from camkit.models_def.kinds.hdr.material import HdrMaterial
from camkit.models_def.kinds.hdr.recipe import HdrRecipe, to_hdr_recipe
from camkit.models_def.kinds.hdr.samples import HdrCamera
from tests.hdr_bundle import four_lines
from tests.hdr_recipe import small_recipe

SHIPPED = Path(__file__).resolve().parents[4] / "models_def" / "recipes" / "streak_hdr.toml"

Table = dict[str, Any]


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session")
def tiny_text() -> str:
    """The shipped camera with small samples and a small network."""
    return small_recipe(SHIPPED, "S", "bias = true")


@pytest.fixture
def changed(tiny_text: str) -> Callable[..., Table]:
    """Give the table of the tiny recipe, changed at dotted keys; None takes a key out."""

    def change(**changes: Any) -> Table:
        table = tomllib.loads(tiny_text)
        for dotted, value in changes.items():
            *path, last = dotted.split("__")
            place = table
            for part in path:
                place = place.setdefault(part, {})
            if value is None:
                del place[last]
            else:
                place[last] = value
        return table

    return change


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
