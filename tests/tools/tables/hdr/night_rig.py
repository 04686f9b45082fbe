"""The tables of snapshot HDR made so small that all of them take seconds."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from camkit.models_def.kinds.hdr import validation
from camkit.models_def.kinds.hdr.material import HdrMaterial
from camkit.models_def.kinds.hdr.thesis import validation as thesis_validation
from camkit.report.bench import known_captures
from tests.hdr_bundle import four_lines
from tests.hdr_recipe import small_recipe
from tools.tables.hdr import night_table, plates

SIDE_PX = 128
TINY = {
    "streak_hdr.toml": ("highlights.S", "bias = true", "plate"),
    "bare_lens.toml": ("whole.M", "in_channels = 3", "bare"),
}
Rig = Callable[..., str]


@pytest.fixture
def rig(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Callable[..., str]
) -> Iterator[Rig]:
    """Give the command of the table, with small recipes, scenes and optics."""
    recipes = tmp_path / "recipes"
    recipes.mkdir()
    for name, (network, config, optics) in TINY.items():
        thesis = f'\n[thesis]\noptics = "{optics}"\n'
        small = small_recipe(plates.RECIPES / name, network, config, thesis)
        (recipes / name).write_text(small, encoding="utf-8")
    for module in (plates, night_table):
        monkeypatch.setattr(module, "RECIPES", recipes)
    monkeypatch.setattr(plates, "compute_material", small_material)
    monkeypatch.setattr(known_captures, "SCENE_PX", SIDE_PX)
    monkeypatch.setattr(validation, "CAPTURES", 1)
    monkeypatch.setattr(thesis_validation, "SAMPLES", 1)
    forget()
    yield lambda *words: command("hdr", *words)
    forget()


def forget() -> None:
    """Let what was computed of other recipes go."""
    plates.material_of.cache_clear()
    plates.shipped_recipe.cache_clear()


def small_material(recipe: Any, *_folders: Path) -> HdrMaterial:
    """Give four short lines, whatever the plate; their angles tell plates apart."""
    lines = four_lines()
    turn = len(recipe.plate.file) / 100
    return HdrMaterial(
        streaks=replace(
            lines,
            angles_rad=lines.angles_rad + turn,
            pixel_pitch_um=recipe.sensor.pixel_pitch_um,
        )
    )


def write_pictures(folder: Path) -> Path:
    """Write one HDR picture with lamps and one file that is none."""
    folder.mkdir()
    light = np.random.default_rng(0).random((SIDE_PX, SIDE_PX, 3), np.float32) ** 8
    light[60:66, 60:66] = 40.0
    cv2.imwrite(str(folder / "esplanade.hdr"), light)
    (folder / "torn.exr").write_bytes(b"no picture")
    return folder
