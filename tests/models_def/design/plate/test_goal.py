"""The goal of a plate: met by a lens that gives 6 % to the streaks, missed by all others."""

import math
from dataclasses import replace
from typing import Any

import pytest
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.design.plate.goal import Goal, goal_loss, goal_shares, masks_of

GOAL = Goal(angles_deg=(0.0, 60.0, 120.0), near_px=6.0, far_px=30.0)
SIDE = 71


def _bare() -> Tensor:
    """Give a PSF with a halo, as a lens has one."""
    place = torch.arange(SIDE, dtype=torch.float32) - SIDE // 2
    r2 = place[:, None] ** 2 + place[None, :] ** 2
    light = torch.exp(-r2 / 2) + 1e-3 / (1 + r2) ** 1.5
    return light / light.sum()


def _written(goal: Goal, share: float) -> Tensor:
    """Give the bare lens with a share of its light moved evenly to the streaks."""
    parts = masks_of(goal, SIDE).parts
    even = (parts / parts.sum((-2, -1), keepdim=True)).mean(0)
    return (1 - share) * _bare() + share * even


@pytest.mark.parametrize("lengths", [1, 4])
def test_what_meets_the_goal_has_no_loss_and_everything_else_has(lengths: int) -> None:
    goal = replace(GOAL, lengths=lengths)
    masks, bare = masks_of(goal, SIDE), _bare()
    assert masks.parts.shape[0] == (1 if lengths == 1 else 3 * lengths)
    assert float(goal_loss(_written(goal, 0.06), bare, masks, goal)) == pytest.approx(0, abs=1e-7)
    # Sun 2021, eq. (5.12), by hand: 0.05 |0.94 - 1| c + 0.1 |0.06 - 0| but for the halo's 6 %
    core = float((bare * masks.core).sum())
    halo = float((bare * masks.parts.sum(0)).sum())
    by_hand = 0.05 * 0.06 * core + 0.1 * (0.06 - 0.06 * halo)
    assert float(goal_loss(bare, bare, masks, goal)) == pytest.approx(by_hand, rel=1e-4)


def test_one_mask_does_not_ask_for_length_and_many_do() -> None:
    bare = _bare()
    short = torch.zeros(SIDE, SIDE)
    near = masks_of(replace(GOAL, far_px=10.0), SIDE).parts[0]
    short = 0.94 * bare + 0.06 * near / near.sum()
    for lengths, loss in ((1, 0.0), (4, 0.07)):
        goal = replace(GOAL, lengths=lengths)
        found = float(goal_loss(short, bare, masks_of(goal, SIDE), goal))
        assert found == pytest.approx(0.1 * loss, abs=0.003 * lengths / 4 + 1e-7)


def test_what_is_reached_is_told_by_colour() -> None:
    light = torch.stack([_written(GOAL, 0.06), _written(GOAL, 0.02)])
    found = goal_shares(light, torch.stack([_bare()] * 2), masks_of(GOAL, SIDE))
    assert found.core_share == pytest.approx((0.94, 0.98), abs=1e-4)
    assert found.streak_share == pytest.approx((0.06, 0.02), abs=1e-4)
    # of arms from 6 to 30 px, what lies beyond 14: two thirds
    assert found.far_share == pytest.approx((2 / 3, 2 / 3), abs=0.02)


def test_the_length_of_nothing_is_none() -> None:
    bare = _bare()
    assert goal_shares(bare[None], bare[None], masks_of(GOAL, SIDE)).far_share == (0.0,)


def test_masks_lie_where_lines_do_and_do_not_overlap() -> None:
    masks = masks_of(replace(GOAL, lengths=3), SIDE)
    assert float(masks.parts.sum(0).max()) == 1
    middle = SIDE // 2
    x, y = round(20 * math.cos(math.pi / 3)), round(20 * math.sin(math.pi / 3))
    line = masks.parts.sum(0)
    assert line[middle + y, middle + x] == line[middle - y, middle - x] == 1
    assert line[middle, middle + 20] == 1
    assert line[middle + 20, middle] == 0
    assert float((masks.core * line).sum()) == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"angles_deg": ()}, "a goal needs a line"),
        ({"near_px": 30.0}, "near_px < far_px"),
        ({"core_px": 7.0}, "core_px <= near_px"),
        ({"core_share": 1.2}, "core_share lies in 0..1"),
        ({"streak_share": 0.0}, "streak_share between 0 and 1"),
        ({"half_width_px": math.nan}, "half_width_px > 0"),
        ({"lengths": 0}, "lengths must be >= 1"),
        ({"core_weight": -1.0}, "weights >= 0"),
    ],
)
def test_a_goal_that_is_none_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        replace(GOAL, **changes)


def test_a_window_too_small_for_the_streaks_is_refused_with_what_it_takes() -> None:
    with pytest.raises(ContractError, match="side_px >= 61; got 51"):
        masks_of(GOAL, 51)
