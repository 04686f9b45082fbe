"""The goal of a plate: the shares of the light that should go to the core and to the streaks.

The thesis wants 94 % of the light in the core and 6 % in the streaks. No lens has 100 % of its
light in the core, and its own halo overlaps the streaks: so shares are counted against the bare
lens, colour by colour. A plate meets the goal if it moves 6 % of the bare lens's light to the
streaks and leaves the rest in place. Phases turn faster in blue than in red, so no plate meets the
goal in every colour.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError

_NOTHING: Final = 0.005
"""Of the light; less is not looked at for its length."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """The masks and what they should hold; distances from the middle in pixels.

    Attributes:
        angles_deg: (line,), from +x (right) towards +y (down); every line has two arms.
        core_share: Of the bare lens's core, to be left.
        streak_share: Of the light, to be written to the streaks.
        core_weight: Of the core's term.
        streak_weight: Of the streaks' term.
        core_px: Radius of the core.
        near_px: Where arms begin.
        far_px: Where they end.
        half_width_px: Of an arm, to both sides.
        lengths: Parts of every line, from near to far, that are to hold alike; with 1 there is one
            mask for all arms, and nothing asks for their length.
    """

    angles_deg: tuple[float, ...] = (0.0, 90.0)
    core_share: float = 0.94
    streak_share: float = 0.06
    core_weight: float = 0.05
    streak_weight: float = 0.1
    core_px: float = 3.0
    near_px: float = 8.0
    far_px: float = 120.0
    half_width_px: float = 3.0
    lengths: int = 1

    def __post_init__(self) -> None:
        """Refuse values that are no goal.

        Raises:
            ContractError: If so.
        """
        if not (self.angles_deg and 0 < self.core_px <= self.near_px < self.far_px):
            raise ContractError(
                "a goal needs a line, and 0 < core_px <= near_px < far_px; got "
                f"{list(self.angles_deg)}, {self.core_px}, {self.near_px}, {self.far_px}"
            )
        if not (0 < self.core_share <= 1 and 0 < self.streak_share < 1 and self.half_width_px > 0):
            raise ContractError(
                "core_share lies in 0..1, streak_share between 0 and 1, half_width_px > 0; got "
                f"{self.core_share}, {self.streak_share}, {self.half_width_px}"
            )
        if self.lengths < 1 or min(self.core_weight, self.streak_weight) < 0:
            raise ContractError(
                f"lengths must be >= 1 and weights >= 0; got {self.lengths}, {self.core_weight}, "
                f"{self.streak_weight}"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Masks:
    """A goal on pixels.

    Attributes:
        core: (side, side), 1 inside.
        parts: (part, side, side), 1 inside; they do not overlap.
        outer: (side, side), the streaks beyond a third of their length.
    """

    core: Tensor
    parts: Tensor
    outer: Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalShares:
    """The shares of the goal that a PSF reaches, by colour.

    Attributes:
        core_share: Of the bare lens's core, left.
        streak_share: Of the light, written to the streaks.
        far_share: Of what is written, beyond a third of the streaks' length; 0 where next to
            nothing is written.
    """

    core_share: tuple[float, ...]
    streak_share: tuple[float, ...]
    far_share: tuple[float, ...]


def masks_of(goal: Goal, side_px: int) -> Masks:
    """Draw the masks.

    Raises:
        ContractError: If the window does not hold the streaks.

    References: Sun 2021, fig. 5.3c.
    """
    half = side_px // 2
    if goal.far_px > half:
        raise ContractError(
            f"streaks of {goal.far_px:g} px want a window of side_px >= {2 * goal.far_px + 1:.0f}; "
            f"got {side_px}"
        )
    place = torch.arange(side_px, dtype=torch.float64) - half
    distance = (place[:, None] ** 2 + place[None, :] ** 2).sqrt()
    lines = []
    streaks = torch.zeros(side_px, side_px, dtype=torch.bool)
    for angle_deg in goal.angles_deg:
        angle = math.radians(angle_deg)
        offset = -math.sin(angle) * place[None, :] + math.cos(angle) * place[:, None]
        # where lines cross, the first one has the light
        lines.append((offset.abs() <= goal.half_width_px) & ~streaks)
        streaks |= lines[-1]
    edges = torch.linspace(goal.near_px, goal.far_px, goal.lengths + 1, dtype=torch.float64)
    rings = [(distance > near) & (distance <= far) for near, far in itertools.pairwise(edges)]
    if goal.lengths == 1:
        parts = [streaks & rings[0]]
    else:
        parts = [line & ring for line in lines for ring in rings]
    third = goal.near_px + (goal.far_px - goal.near_px) / 3
    return Masks(
        core=(distance <= goal.core_px).float(),
        parts=torch.stack(parts).float(),
        outer=(streaks & (distance > third) & (distance <= goal.far_px)).float(),
    )


def goal_loss(light: Tensor, bare: Tensor, masks: Masks, goal: Goal) -> Tensor:
    """Return the distance of a colour's PSF from the goal.

    Args:
        light: (side, side), shares of the light.
        bare: The same of the lens without the plate.
        masks: Of the goal, on these pixels.
        goal: Shares and weights.

    References: Sun 2021, eq. (5.12), whose 0.94 and 0.06 are counted against the bare lens here.
    """
    core, bare_core = ((psf * masks.core).sum() for psf in (light, bare))
    parts, bare_parts = (torch.einsum("yx,pyx->p", psf, masks.parts) for psf in (light, bare))
    targets = goal.streak_share / len(parts) + goal.core_share * bare_parts
    return (
        goal.core_weight * (goal.core_share * bare_core - core).abs()
        + goal.streak_weight * (targets - parts).abs().sum()
    )


def goal_shares(light: Tensor, bare: Tensor, masks: Masks) -> GoalShares:
    """Return the shares of the goal that PSFs (colour, side, side) reach.

    What is written is what lies in the streaks beyond the bare lens's light there, which sinks as
    its core does.
    """
    core = (light * masks.core).sum((-2, -1)) / (bare * masks.core).sum((-2, -1))
    added = light - core[:, None, None] * bare
    written = (added * masks.parts.sum(0)).sum((-2, -1))
    outer_share = (added * masks.outer).sum((-2, -1)) / written
    outer_share = torch.where(written > _NOTHING, outer_share, torch.zeros_like(outer_share))
    return GoalShares(
        core_share=tuple(core.tolist()),
        streak_share=tuple(written.tolist()),
        far_share=tuple(outer_share.tolist()),
    )
