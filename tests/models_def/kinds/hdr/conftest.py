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

SHIPPED = Path(__file__).resolve().parents[4] / "models_def" / "recipes" / "streak_hdr.toml"
TABLES = """
[data]
procedural_scenes = 1
scene_px = 192
sample_px = 64
capture_px = 128
surround_px = 16
pool_samples = 40
first_samples = 2
steps_per_sample = 4
saturated_min = 0.01
saturated_max = 0.03

[schedule]
steps = 2
batch = 2
patch_px = 32
warmup_steps = 1

[networks.S]
network = "lean_s"
config = { widths = [16, 16], encoder_blocks = [0], decoder_blocks = [0], bias = true }
"""

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
    text = SHIPPED.read_text(encoding="utf-8")
    return text[: text.index("[data]")] + TABLES


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
