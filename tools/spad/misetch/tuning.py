"""A network trained on for some CPU-minutes behind another PSF; what is done is not done again.

The recipe is the checkpoint's own, with another PSF and a slower start of the schedule.
"""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.models_def.kinds.spad.training import SpadMaterial
from camkit.models_def.training.checkpoint import Checkpoint, read_checkpoint
from camkit.models_def.training.kind import read_recipe
from camkit.models_def.training.trainer import TrainOptions, checkpoint_path, train
from camkit.runtime.output.part_file import atomic_output
from tools.spad.table.training import PLATE_FILE, STEPS

LEARNING_RATE: Final = 5e-4
"""A quarter of the recipe's: a network that is trained already would first be spoiled by that."""
RATE_LINE: Final = re.compile(r"^learning_rate = .*$", re.MULTILINE)
AT_THE_END_S: Final = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """How a network is trained on.

    Attributes:
        pictures: To train on; None for procedural scenes alone.
        valid: To validate on at the end; None for procedural ones.
        cpu_minutes: Samples included.
        steps: At which the schedule would end; more than it makes in its time.
    """

    pictures: Path | None = None
    valid: Path | None = None
    cpu_minutes: float = 3.0
    steps: int = STEPS


def tuned(
    start: Path, checkpoint: Checkpoint, psf: Path, kernel: FloatArray, tuning: Tuning
) -> Checkpoint:
    """Train a network on, in the folder of a PSF file.

    Args:
        start: File of the checkpoint.
        checkpoint: What it holds.
        psf: File of the PSF.
        kernel: (11, 11), what that file holds.
        tuning: How.

    Raises:
        ContractError: If the recipe names no PSF, or another was trained with there.
    """
    folder, recipe = psf.parent, psf.with_suffix(".toml")
    with atomic_output(recipe) as part:
        part.write_text(recipe_text(checkpoint.recipe_toml, psf.name), encoding="utf-8")
    material = SpadMaterial(kernel=kernel)
    options = TrainOptions(out_dir=folder, size=checkpoint.size, role=checkpoint.role)
    out = checkpoint_path(read_recipe(recipe), options, None)
    known = read_checkpoint(out) if out.exists() else None
    if known is not None and _is_done(known, material, tuning):
        return known
    options = TrainOptions(
        out_dir=folder,
        size=checkpoint.size,
        role=checkpoint.role,
        data_folder=tuning.pictures,
        valid_folder=tuning.valid,
        steps=tuning.steps,
        max_cpu_minutes=tuning.cpu_minutes,
        start=None if known else start,
        resume=known is not None,
        validate_s=AT_THE_END_S,
    )
    train(recipe, options, material=material)
    for samples in folder.glob("samples_*"):
        shutil.rmtree(samples)
    return read_checkpoint(out)


def _is_done(known: Checkpoint, material: SpadMaterial, tuning: Tuning) -> bool:
    had_its_time = known.cpu_s >= 60 * tuning.cpu_minutes
    return had_its_time and known.bank_digest == material.digest()


def ending(checkpoint: Checkpoint) -> dict[str, Any]:
    """Return how a training ended, as plain values."""
    return {
        "cpu_s": round(checkpoint.cpu_s, 1),
        "steps": checkpoint.step,
        "valid_db": None if checkpoint.valid_db is None else round(checkpoint.valid_db, 3),
    }


def recipe_text(text: str, psf: str) -> str:
    """Return a recipe that names another PSF, and the rate of learning of one who knows already.

    Raises:
        ContractError: If it does not say both where they are expected.
    """
    for line in (PLATE_FILE, RATE_LINE):
        if len(line.findall(text)) != 1:
            raise ContractError(
                f"the checkpoint's recipe must have one line {line.pattern}; give a checkpoint "
                "that was trained by spad_sr.toml"
            )
    named = PLATE_FILE.sub(f'psf = "{psf}"', text)
    return RATE_LINE.sub(f"learning_rate = {LEARNING_RATE:g}", named)
