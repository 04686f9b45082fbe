"""A snapshot HDR camera so small that a step of the thesis's networks takes no second."""

import tomllib
from pathlib import Path

import pytest

from camkit.models_def.kinds.hdr.material import HdrMaterial
from camkit.models_def.toml_table import key_line
from camkit.models_def.training.kind import to_recipe
from tests.hdr_bundle import four_lines

RECIPES = Path(__file__).resolve().parents[5] / "models_def" / "recipes"
BLOCKS = [2, 2, 2, 2, 2]
NETWORKS = {
    "split": ("thesis_split", {"width": 4, "dilations": [1, 2], "vgg_widths": BLOCKS}),
    "highlight": ("thesis_highlight", {"widths": [4, 6]}),
    "fusion": ("thesis_fusion", {"width": 4, "merged": 4}),
    "whole": (
        "thesis_chain",
        {
            "splitting": {"width": 4, "dilations": [1, 2], "vgg_widths": BLOCKS},
            "highlight": {"widths": [4, 6]},
            "fusion": {"width": 4, "merged": 4},
        },
    ),
}
TABLES = """
[data]
procedural_scenes = 1
scene_px = 128
sample_px = 64
capture_px = 96
surround_px = 8
first_samples = 2
pool_samples = 40
steps_per_sample = 4
saturated_min = 0.01
saturated_max = 0.03

[glare]
reach_px = 40

[schedule]
steps = 4
batch = 2
patch_px = 32
warmup_steps = 1
precision = "float32"

[networks.whole.M]
network = "lean_s"
config = { in_channels = 3 }

"""


def small_text(**thesis) -> str:
    """Give `streak_thesis` made small; keywords are keys of [thesis]."""
    text = (RECIPES / "streak_thesis.toml").read_text(encoding="utf-8")
    settings = {"random_vgg": True, "vgg_widths": BLOCKS} | thesis
    lines = ["[thesis]", *(key_line(k, v) for k, v in settings.items())]
    for role, (name, config) in NETWORKS.items():
        lines += ["", f"[networks.{role}.S]", key_line("network", name)]
        flat = {k: v for k, v in config.items() if not isinstance(v, dict)}
        lines += [key_line(f"config.{k}", v) for k, v in flat.items()]
        for part in config.keys() - flat.keys():
            lines += [key_line(f"config.{part}.{k}", v) for k, v in config[part].items()]
    return text[: text.index("[data]")] + TABLES + "\n".join(lines)


@pytest.fixture
def small_recipe():
    """Give a maker of small recipes; keywords are keys of [thesis]."""

    def make(**thesis):
        return to_recipe(tomllib.loads(small_text(**thesis)))

    return make


@pytest.fixture(scope="session")
def streaks():
    return HdrMaterial(streaks=four_lines())
