"""A small trial of fine-tuning on procedural scenes: does it behave, and which weights to use?

    python -m tools.fine_tuning_trial FOLDER --steps 300

A narrow trimmed U-Net is trained, then a narrow generator is started from it and fine-tuned with
the loss weights of eq. (6.12) in both orders, and once without discriminators. Prints one Markdown
row each; minutes on one core.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch

from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.fine_tuning.refinement import FineTuningOptions, make_refinement
from camkit.models_def.training.log import read_log
from camkit.models_def.training.psf_bank import PsfBank, gaussian_bank
from camkit.models_def.training.recipe import Recipe, read_recipe
from camkit.models_def.training.samples import corner_height_mm
from camkit.models_def.training.trainer import TrainOptions, train
from camkit.models_def.training.validation import make_validation_captures, to_srgb

RECIPE = Path(__file__).resolve().parents[1] / "models_def" / "recipes" / "duet.toml"
SMALLER = {
    "procedural_scenes = 48": "procedural_scenes = 6\nsample_px = 128\nscene_px = 320",
    "first_samples = 300": "first_samples = 40",
    "pool_samples = 2000": "pool_samples = 160",
}
NETWORKS = """
[networks.start]
network = "trimmed_unet"
config = { widths = [8, 16, 32] }
schedule = { steps = STEPS, batch = 4, patch_px = 64, precision = "float32" }

[networks.full]
network = "full_unet"
config = { widths = [8, 16, 32, 32, 32, 32, 32] }

[fine_tuning]
discriminator_width = 16
WEIGHTS
schedule = { steps = STEPS, batch = 2, patch_px = 128, warmup_steps = 20 }
"""
RUNS = {
    "cited order, 0.006 and 0.5": "perceptual_weight = 0.006\npixel_weight = 0.5",
    "thesis's order, 0.5 and 0.006": "perceptual_weight = 0.5\npixel_weight = 0.006",
    "cited order, no discriminators": "global_weight = 0.0\nlocal_weight = 0.0",
}
BLOCK_PX = 16


def main() -> None:
    """Train the start and every run, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--steps", type=int, default=300)
    given = parser.parse_args()
    torch.set_num_threads(1)
    path, recipe, bank = write_recipe(given.folder, given.steps, "")
    first = train(path, options(given.folder, "start"), bank=bank)
    print("| run | PSNR, dB | colour error, 1/255 | D global | D local | CPU s |")
    print("|---|---|---|---|---|---|")
    print(f"| Wiener bank | {first.wiener_db:.2f} | | | | |")
    error = colour_error(first.checkpoint, recipe, bank)
    print(f"| start, trimmed U-Net | {first.valid_db:.2f} | {error:.2f} | | | {first.cpu_s:.0f} |")
    for name, weights in RUNS.items():
        print(row(name, weights, given.folder, given.steps, first.checkpoint), flush=True)


def write_recipe(folder: Path, steps: int, weights: str) -> tuple[Path, Recipe, PsfBank]:
    """Write duet's recipe with narrow networks and few scenes; give it with Gaussian kernels."""
    text = RECIPE.read_text(encoding="utf-8")
    for old, new in SMALLER.items():
        text = text.replace(old, new)
    text += NETWORKS.replace("STEPS", str(steps)).replace("WEIGHTS", weights)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "trial.toml"
    path.write_text(text, encoding="utf-8")
    recipe = read_recipe(path)
    height = corner_height_mm(recipe)
    return path, recipe, gaussian_bank(sensor_height_mm=height, axis_px=1.0, corner_px=2.5)


def options(folder: Path, size: str) -> TrainOptions:
    """Give the options of a run that makes its own samples and replaces the run before it."""
    return TrainOptions(
        out_dir=folder, size=size, overwrite=True, workers=0, validate_s=1e9, checkpoint_s=1e9
    )


def row(name: str, weights: str, folder: Path, steps: int, start: Path) -> str:
    """Run one fine-tuning and give its row."""
    began = time.process_time()
    path, recipe, bank = write_recipe(folder, steps, weights)
    refinement = make_refinement(recipe, FineTuningOptions(start=start, size="full"))
    result = train(path, options(folder, "full"), bank=bank, refinement=refinement)
    last: dict[str, Any] = [e for e in read_log(result.log) if "loss" in e][-1]
    error = colour_error(result.checkpoint, recipe, bank)
    scores = [f"{last[f'discriminator_{d}']:.3f}" for d in ("global", "local")]
    seconds = time.process_time() - began
    cells = [name, f"{result.valid_db:.2f}", f"{error:.2f}", *scores, f"{seconds:.0f}"]
    return f"| {' | '.join(cells)} |"


def colour_error(checkpoint: Path, recipe: Recipe, bank: PsfBank) -> float:
    """Give the RMS error of hue and saturation of block means, in 1/255 of sRGB."""
    network = load_network(read_checkpoint(checkpoint))
    errors = []
    for capture in make_validation_captures(recipe, bank, None)[::4]:
        with torch.no_grad():
            restored = to_srgb(network(capture.sample.planes[None])[0], capture, recipe)
        gap = restored - capture.sharp
        side = gap.shape[-1] // BLOCK_PX
        means = gap.reshape(3, side, BLOCK_PX, side, BLOCK_PX).mean((2, 4))
        errors.append(np.square(means - means.mean(0)).mean())
    return 255 * float(np.sqrt(np.mean(errors)))


if __name__ == "__main__":
    main()
