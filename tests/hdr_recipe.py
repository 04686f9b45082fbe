"""Recipes of snapshot HDR made so small that a step of their network takes no second."""

from pathlib import Path

DATA = """
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
"""
SCHEDULE = """
[schedule]
steps = 2
batch = 2
patch_px = 32
warmup_steps = 1
"""


def small_recipe(path: Path, network: str, config: str, more: str = "") -> str:
    """Give a shipped recipe with small samples and a small network.

    Args:
        path: Of the recipe.
        network: Its place, such as "highlights.S".
        config: Of `lean_s`, beside its widths and blocks.
        more: Tables of the recipe that are no sensor, plate, data, schedule or network.
    """
    text = path.read_text(encoding="utf-8")
    small = f"widths = [16, 16], encoder_blocks = [0], decoder_blocks = [0], {config}"
    return (
        f"{text[: text.index('[data]')]}{DATA}{more}{SCHEDULE}\n"
        f'[networks.{network}]\nnetwork = "lean_s"\nconfig = {{ {small} }}\n'
    )
