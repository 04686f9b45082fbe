import pytest
import torch

from camkit.models_def.training.recipe import ScheduleRecipe
from camkit.models_def.training.schedule import (
    ema_decay,
    learning_rate,
    progress_of,
    update_average,
)

PLAN = ScheduleRecipe(learning_rate=1e-3, warmup_steps=10, final_rate=0.01)


def test_rate_warms_up_then_falls_to_its_end():
    assert learning_rate(PLAN, 0, 0.0) == pytest.approx(1e-4)
    assert learning_rate(PLAN, 9, 0.0) == pytest.approx(1e-3)
    rates = [learning_rate(PLAN, 1000, p / 20) for p in range(21)]
    assert rates == sorted(rates, reverse=True)
    assert rates[-1] == pytest.approx(1e-5)


def test_progress_ends_at_the_steps_or_the_time_whichever_comes_first():
    assert progress_of(30, 60) == 0.5
    assert progress_of(30, 60, 0.9) == 0.9
    assert progress_of(30, 60, 9.9) == 1.0
    assert progress_of(59, 60) < 1.0


def test_average_of_constant_weights_is_that_constant():
    average = [torch.zeros(3)]
    for step in range(200):
        update_average(average, [torch.ones(3)], ema_decay(PLAN, step))
    assert torch.allclose(average[0], torch.ones(3), atol=1e-3)


def test_average_soon_follows_at_the_start_and_is_slow_later():
    assert ema_decay(PLAN, 0) < 0.2
    assert ema_decay(PLAN, 100_000) == PLAN.ema_decay
