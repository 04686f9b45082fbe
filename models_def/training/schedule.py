"""Learning rate, weight average and progress of a training run."""

import math
from collections.abc import Iterable

import torch
from torch import Tensor

from camkit.models_def.training.recipe import ScheduleRecipe


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
