"""Options, result, learning rate, weight average and progress of a training run."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.training.recipe import ScheduleRecipe

NO_STEP: Final = "no step was trained: the time ended before the first one; give more minutes"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainOptions:
    """The options of a run besides its recipe.

    Attributes:
        out_dir: Checkpoint, log and sample pool are kept here.
        size: Which network of the recipe.
        role: Of which role; None for a recipe of one.
        data_folder: Pictures to train on; None for procedural scenes alone.
        valid_folder: Pictures to choose by; None for procedural scenes.
        steps: Steps of the whole schedule; None for the recipe's.
        max_minutes: Wall time after which the run, decay included, ends; None for its steps.
        max_cpu_minutes: The same of CPU time, that of the workers included. Both count all of the
            run: kernels that are traced, samples, and validations, the last one too.
        start: Checkpoint or bundle with the same network, of another camera say, whose weights
            are the first ones; None for random weights.
        stop_at_step: Stop there though the schedule goes on, as an interruption would.
        session_minutes: The same after so much wall time of this call.
        resume: Go on from the checkpoint in `out_dir`.
        overwrite: Start anew over a checkpoint that lies there.
        threads: Threads of torch.
        workers: Processes that make samples; 0 makes them in this process.
        device: cpu or cuda.
        vgg: Weights of VGG-19, where the loss of the role looks at it.
        sharp_folder: Sharp pictures without captures, where the loss of the role has a critic.
        pairs: Folder of real pairs, where the kind of camera trains on them.
        checkpoint_s: Seconds between checkpoints.
        validate_s: Seconds between validations.
    """

    out_dir: Path
    size: str = "M"
    role: str | None = None
    data_folder: Path | None = None
    valid_folder: Path | None = None
    steps: int | None = None
    max_minutes: float | None = None
    max_cpu_minutes: float | None = None
    start: Path | None = None
    stop_at_step: int | None = None
    session_minutes: float | None = None
    resume: bool = False
    overwrite: bool = False
    threads: int = 1
    workers: int = 1
    device: str = "cpu"
    vgg: Path | None = None
    sharp_folder: Path | None = None
    pairs: Path | None = None
    checkpoint_s: float = 100.0
    validate_s: float = 180.0

    def __post_init__(self) -> None:
        for name in ("max_minutes", "max_cpu_minutes", "session_minutes"):
            minutes = getattr(self, name)
            if minutes is not None and minutes <= 0:
                raise ContractError(f"{name} must be > 0; got {minutes}")
        if self.steps is not None and self.steps < 1:
            raise ContractError(f"steps must be >= 1; got {self.steps}")
        if self.start is not None and self.resume:
            raise ContractError("a run that is resumed has begun; leave start away")
        if self.overwrite and self.resume:
            raise ContractError(
                "resume goes on from the checkpoint, overwrite drops it: choose one"
            )
        if self.threads < 1 or self.workers < 0:
            raise ContractError(
                f"threads must be >= 1, workers >= 0; got {self.threads}, {self.workers}"
            )
        if self.device != "cpu" and not torch.cuda.is_available():
            raise ContractError(f"device {self.device} is not there; use cpu")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainResult:
    """The result of a run.

    Attributes:
        checkpoint: The last checkpoint.
        log: The log.
        steps: Steps done, earlier runs included.
        elapsed_s: Wall time, earlier runs included.
        cpu_s: CPU time, workers and earlier runs included.
        baselines: What the network must beat: name -> validation dB.
        valid_db: Of the weights that are exported.
    """

    checkpoint: Path
    log: Path
    steps: int
    elapsed_s: float
    cpu_s: float
    baselines: Mapping[str, float]
    valid_db: float

    def to_json(self) -> dict[str, Any]:
        """Return the result as a flat mapping of plain values."""
        flat = {f"{name}_db": db for name, db in self.baselines.items()}
        return {
            "checkpoint": str(self.checkpoint),
            "log": str(self.log),
            "steps": self.steps,
            "elapsed_s": self.elapsed_s,
            "cpu_s": self.cpu_s,
            **flat,
            "valid_db": self.valid_db,
        }


def progress_of(step: int, steps: int, by_time: float = 0.0) -> float:
    """Return the finished share of the schedule, 0..1.

    By steps alone it is exact and repeatable. With a time budget, of which a share is spent, it is
    whichever of the two is further, so that the decay ends in time on a machine that is slower than
    hoped.
    """
    return min(1.0, max(step / steps, by_time))


def learning_rate(recipe: ScheduleRecipe, step: int, progress: float) -> float:
    """Return the rate: linear warm-up, then a half cosine over the progress."""
    warmup = min(1.0, (step + 1) / max(1, recipe.warmup_steps))
    cosine = 0.5 * (1 + math.cos(math.pi * progress))
    floor = recipe.final_rate
    return recipe.learning_rate * warmup * (floor + (1 - floor) * cosine)


def ema_decay(recipe: ScheduleRecipe, step: int) -> float:
    """Return the decay of the weight average; shorter at the start, so that it soon follows."""
    return min(recipe.ema_decay, (step + 1) / (step + 10))


@torch.no_grad()
def update_average(average: list[Tensor], weights: Iterable[Tensor], decay: float) -> None:
    """Move the averaged weights towards the current ones, in place."""
    current = [w.detach() for w in weights]
    torch._foreach_lerp_(average, current, 1.0 - decay)


def short_time_text(
    limit: str,
    samples: tuple[int, int, int],
    *,
    spent_s: float,
    kept_s: float,
    making_s: float,
) -> str:
    """Return the line of a run whose limit of time ended before its first step.

    Args:
        limit: With its unit: "2 minutes".
        samples: Those there at first, those there now, and those in all.
        spent_s: Time so far, and that of the last validation.
        kept_s: The part of it for what a repeat has already, but for samples.
        making_s: The part of it for samples.
    """
    first, ready, total = samples
    is_known = ready > first or ready == total
    more = "about" if is_known else "more than"
    need_s = spent_s + making_s * (total - ready) / max(1, ready - first)
    repeat_s = need_s - kept_s - making_s
    return (
        f"no step was trained: preparation and last validation take {more} {need_s / 60:.1f} of "
        f"{limit}; what was made ({ready} of {total} samples) is kept, so a repeat in this folder "
        f"with {option_text('overwrite')} needs {more} {repeat_s / 60:.1f} for them"
    )
