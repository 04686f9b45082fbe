"""A camera and a plate so small that a step of their joint design takes no second."""

from pathlib import Path
from typing import Any

from camkit.models_def.design.plate.plate_recipe import PlateRecipe, to_plate_recipe
from camkit.models_def.design.plate.reader import PlateReader, open_reader
from camkit.models_def.design.plate.reader_recipe import ReaderRecipe
from tests.models_def.design.plate.test_plate_recipe import RECIPES, table

TABLES = """
[data]
saturated_min = 0.01
saturated_max = 0.03
as_it_is_share = 0.0

[schedule]
learning_rate = 2e-3
warmup_steps = 1
ema_decay = 0.9

[networks.whole.small]
network = "lean_s"

[networks.whole.small.config]
widths = [16, 16]
encoder_blocks = [0]
decoder_blocks = [0]
bias = true
in_channels = 3

[networks.whole.chain]
network = "thesis_chain"

[networks.whole.two]
network = "lean_s"
"""
PIXELS = {"pitch_um": 6.0, "side_px": 41, "wavelengths_um": [0.46, 0.54, 0.61], "samples": 2}
READER: dict[str, Any] = {
    "recipe": "camera.toml",
    "size": "small",
    "network_steps": 2,
    "batch": 2,
    "patch_px": 32,
    "scenes": 2,
    "scene_px": 112,
    "valid_patches": 2,
}


def camera_text() -> str:
    """Give the recipe of the camera."""
    text = (RECIPES / "streak_thesis.toml").read_text("utf-8")
    return text[: text.index("[data]")] + TABLES


def write_camera(folder: Path) -> None:
    """Write it as the reader names it."""
    (folder / "camera.toml").write_text(camera_text(), encoding="utf-8")


def joint(of_reader: dict[str, Any] | None = None, **changes: Any) -> PlateRecipe:
    """Give a plate with a reader; keywords are its other tables."""
    given = {"pixels": PIXELS, **changes}
    return to_plate_recipe(table(**given, reader={**READER, **(of_reader or {})}))


def reader_of(folder: Path, **changes: Any) -> PlateReader:
    """Open the reader alone; keywords are keys of its table."""
    chosen = ReaderRecipe(**{**READER, **changes})
    return open_reader(chosen, psf_px=41, colours=3, seed=1, folder=folder)
