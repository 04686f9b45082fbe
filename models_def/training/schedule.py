"""Learning rate, weight average and progress of a training run."""

import math
from collections.abc import Iterable
from typing import Final

import torch
from torch import Tensor

from camkit.caller import option_text
from camkit.models_def.training.recipe import ScheduleRecipe

NO_STEP: Final = (
    "no step was trained: the time ended before the first one; give more minutes"
)


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
    need_s: float, repeat_s: float, *, limit: str, made: str, is_known: bool
) -> str:
    """Return the line of a run whose limit of time ended before its first step.

    Args:
        need_s: Time of a run without a step, preparation and last validation.
        repeat_s: The same of a repeat in the same folder.
        limit: With its unit: "2 minutes".
        made: Samples that are kept: "310 of 1200 samples"; empty where none were missing.
        is_known: Whether the times can be predicted; they are the least ones otherwise.
    """
    more = "about" if is_known else "more than"
    kept = "what was made" + (f" ({made})" if made else "")
    return (
        f"no step was trained: preparation and last validation take {more} {need_s / 60:.1f} of "
        f"{limit}; {kept} is kept, so a repeat in this folder with {option_text('overwrite')} "
        f"needs {more} {repeat_s / 60:.1f} for them"
    )
