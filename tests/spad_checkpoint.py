"""A small camera of single photons as training leaves it, of a network that was not trained."""

from pathlib import Path
from typing import Any

import torch

from camkit.models_def.kinds.spad.networks import build_spad_network
from camkit.models_def.training.checkpoint import Checkpoint, write_checkpoint

NETWORK = "sub_pixel_s"
CONFIG = {"width": 16, "blocks": 1}


def tiny_recipe(sampling: str) -> str:
    """Give a recipe with the lines of its table `sampling`."""
    return f"""
name = "tiny"
kind = "spad"

[sensor]
type = "spad"
width_px = 64
height_px = 32
pixel_pitch_um = 150.0
fill_factor = 0.0314
sub_pixels = 4
phase = 2

[sampling]
{sampling}

[schedule]
steps = 4
learning_rate = 2e-3
batch = 2
patch_px = 8

[networks.S]
network = "{NETWORK}"
config = {{ width = 16, blocks = 1 }}
"""


def write_untrained(path: Path, recipe_toml: str, **changes: Any) -> Path:
    """Write a checkpoint; changes are fields of it, `weights` those of another network."""
    weights = changes.pop("weights", None)
    if weights is None:
        torch.manual_seed(3)
        weights = build_spad_network(NETWORK, **CONFIG).state_dict()
    fields: dict[str, Any] = {
        "recipe_toml": recipe_toml,
        "role": "upscale",
        "size": "S",
        "network": NETWORK,
        "config": CONFIG,
        "bank_digest": "",
        "training_data": "none",
        "step": 0,
        "elapsed_s": 0.0,
        "cpu_s": 0.0,
        "valid_db": None,
        "weights": weights,
        "average": weights,
        "optimizer": {},
    }
    write_checkpoint(path, Checkpoint(**fields | changes))
    return path
