"""A recipe to a checkpoint: `camkit.train` and `camkit train`."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from camkit.caller import command_text, option_text
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.models_def.face.torch_need import require_torch
from camkit.runtime.files.in_memory import FilePath, optional_path
from camkit.stopwatch import Stopwatch

if TYPE_CHECKING:
    from camkit.models_def.training.refinement import Refinement
    from camkit.models_def.training.trainer import TrainResult


@checked
def train(
    recipe: FilePath,
    out_dir: FilePath = "runs",
    *,
    size: str = "M",
    role: str | None = None,
    data: FilePath | None = None,
    valid: FilePath | None = None,
    steps: int | None = None,
    max_minutes: float | None = None,
    max_cpu_minutes: float | None = None,
    start: FilePath | None = None,
    fine_tune: FilePath | None = None,
    vgg: FilePath | None = None,
    sharp: FilePath | None = None,
    pairs: FilePath | None = None,
    resume: bool = False,
    overwrite: bool = False,
    threads: int = 1,
    workers: int = 1,
    device: str = "cpu",
    on_note: Callable[[str], object] | None = None,
    stopwatch: Stopwatch | None = None,
) -> "TrainResult":
    """Train one restoration network of a recipe (needs torch).

    Args:
        recipe: Training recipe (.toml).
        out_dir: Folder for checkpoint, log and samples.
        size: Network of the recipe, such as "S" or "M".
        role: Role of the network; None if the recipe has one.
        data: Folder of pictures; None for procedural scenes.
        valid: Folder of validation pictures; None for procedural scenes.
        steps: Steps of the whole schedule; None for the recipe's.
        max_minutes: Limit of wall time, decay included; None for no limit.
        max_cpu_minutes: Limit of CPU time, all processes included; None for no limit.
        start: Checkpoint or bundle with the first weights; None for random ones.
        fine_tune: Checkpoint or bundle to fine-tune with discriminators.
        vgg: VGG-19 weights (.pth, .safetensors), for losses that compare features.
        sharp: Folder of sharp pictures without captures, for the critic of an adversarial loss.
        pairs: Folder of real pairs (`pairs.toml`), which are mixed into the batches.
        resume: Continue from the checkpoint in `out_dir`.
        overwrite: Start anew over a checkpoint there.
        threads: Threads of torch.
        workers: Processes that make samples; 0 makes them in this process. With more, a script
            needs `if __name__ == "__main__":` around the call.
        device: "cpu" or "cuda".
        on_note: Called before the training with what stands in place of files that are missing.
        stopwatch: Measures the time that limits count; None begins now.

    Returns:
        Checkpoint, log, steps, seconds and validation; `to_json()` as `camkit train --json`.

    Raises:
        ContractError: If recipe, options or a checkpoint do not fit.
        UnsupportedError: If torch is not installed, or cameras of this kind cannot be trained.
    """
    require_torch(command_text("train"))
    from camkit.models_def.training import trainer

    refinement: Refinement | None = None
    note = on_note or _ignore
    if fine_tune is not None:
        if sharp is not None:
            raise ContractError(
                f"{option_text('sharp')} is for a critic; fine-tuning has none: leave it away"
            )
        refinement = _fine_tuning(recipe, fine_tune, size, (vgg, pairs), device, note)
        vgg = pairs = None
    elif vgg is None:
        _note_substitute(recipe, size, role, note)
    return trainer.train(
        Path(recipe),
        trainer.TrainOptions(
            out_dir=Path(out_dir),
            size=size,
            role=role,
            data_folder=optional_path(data),
            valid_folder=optional_path(valid),
            steps=steps,
            max_minutes=max_minutes,
            max_cpu_minutes=max_cpu_minutes,
            start=optional_path(start),
            resume=resume,
            overwrite=overwrite,
            threads=threads,
            workers=workers,
            device=device,
            vgg=optional_path(vgg),
            sharp_folder=optional_path(sharp),
            pairs=optional_path(pairs),
        ),
        refinement=refinement,
        stopwatch=stopwatch,
    )


def _note_substitute(
    recipe: FilePath, size: str, role: str | None, note: Callable[[str], object]
) -> None:
    """Report that features are a substitute, where a loss compares any."""
    from camkit.models_def.training.kind import read_recipe
    from camkit.models_def.training.recipe import PICTURE_LOSSES

    schedule = read_recipe(Path(recipe)).network(size, role).schedule
    if schedule.loss in PICTURE_LOSSES and schedule.content.looks:
        note(
            f"no {option_text('vgg')} FILE: features are those of random weights in place of VGG-19"
        )


def _fine_tuning(
    recipe: FilePath,
    start: FilePath,
    size: str,
    files: tuple[FilePath | None, FilePath | None],
    device: str,
    note: Callable[[str], object],
) -> "Refinement":
    """Prepare the fine-tuning of a network with the files of VGG-19 and of real pairs."""
    from camkit.models_def.training.kind import read_recipe
    from camkit.models_def.training.refinement import FineTuningOptions, refining_kind

    vgg, pairs = map(optional_path, files)
    if vgg is None:
        note(
            f"no {option_text('vgg')} FILE: the perceptual term of eq. (6.12) compares sRGB "
            "values, not VGG-19 features"
        )
    options = FineTuningOptions(
        start=Path(start),
        size=size,
        vgg=vgg,
        pairs=pairs,
        device=device,
        recipe_folder=Path(recipe).parent,
    )
    plan = read_recipe(Path(recipe))
    return refining_kind(plan.kind).refinement(plan, options)


def _ignore(_text: str) -> None:
    """Drop a note."""
