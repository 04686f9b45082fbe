"""Where the light of a plate goes: core, streaks, haze; and where the streaks lie."""

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError

CORE_PX: Final = 3.0
"""Light within this distance of the middle is core; a sharp lens has 96 % of its light there."""
HALF_WIDTH_PX: Final = 3.0
"""Light within this distance of a streak's line is the streak's."""
_STEP_DEG: Final = 0.5
_LEAST: Final = 0.25
"""Of the brightest streak; what is fainter is none."""
_END: Final = 0.3
"""Of a streak's usual brightness; where it stays below, the streak has ended."""
_SMOOTH_PX: Final = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class Streak:
    """A line of light through the middle.

    Attributes:
        angle_deg: 0..180, from +x (right) towards +y (down).
        reach_px: How far it reaches to both sides.
    """

    angle_deg: float
    reach_px: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Shares:
    """Shares of the light; they sum to 1, what lies outside the window is haze.

    Attributes:
        core: Within CORE_PX.
        streak: Within HALF_WIDTH_PX of a streak, beyond the core.
        haze: Everywhere else.
    """

    core: float
    streak: float
    haze: float


def find_streaks(psf: Tensor, bare: Tensor) -> tuple[Streak, ...]:
    """Find streaks, brightest first.

    Args:
        psf: (side, side), shares of the light.
        bare: The same of the lens without the plate, whose own halo is no streak.

    Raises:
        ContractError: If the two are no PSFs of one odd side.
    """
    added = _added(psf, bare)
    distance = _distance(added)
    centre = added.shape[0] // 2
    usable = (distance > 2 * CORE_PX) & (distance <= centre)
    angles = torch.arange(0, 180, _STEP_DEG, dtype=torch.float64)
    side = added.shape[0]
    light = torch.stack([added[usable & _near_line(side, float(a))].sum() for a in angles])
    floor = light.median()
    found: list[Streak] = []
    for i in torch.argsort(light, descending=True).tolist():
        above = float(light[i] - floor)
        if above <= _LEAST * float(light.max() - floor) or above <= 1e-4:
            break
        angle = _refined(light, i)
        if all(_apart(angle, other.angle_deg) > 5 for other in found):
            found.append(Streak(angle_deg=angle, reach_px=_reach(added, angle)))
    return tuple(found)


def shares(psf: Tensor, streaks: tuple[Streak, ...]) -> Shares:
    """Share the light of a PSF (side, side) out among core, streaks and haze."""
    distance = _distance(psf)
    core = distance <= CORE_PX
    on_streak = torch.zeros_like(core)
    for streak in streaks:
        on_streak |= _near_line(psf.shape[0], streak.angle_deg) & (distance <= streak.reach_px)
    on_streak &= ~core
    in_core, in_streaks = float(psf[core].sum()), float(psf[on_streak].sum())
    return Shares(core=in_core, streak=in_streaks, haze=1 - in_core - in_streaks)


def _added(psf: Tensor, bare: Tensor) -> Tensor:
    side = psf.shape[-1]
    if psf.ndim != 2 or psf.shape != bare.shape or psf.shape[0] != side or side % 2 == 0:
        raise ContractError(
            f"two PSFs of one odd side are needed; got {tuple(psf.shape)}, {tuple(bare.shape)}"
        )
    middle = (side // 2, side // 2)
    return (psf - bare * (psf[middle] / bare[middle].clamp_min(1e-30))).double()


def _distance(psf: Tensor) -> Tensor:
    """Give the distance of every pixel from the middle."""
    place = torch.arange(psf.shape[0], dtype=torch.float64) - psf.shape[0] // 2
    return (place[:, None] ** 2 + place[None, :] ** 2).sqrt()


def _near_line(side: int, angle_deg: float) -> Tensor:
    place = torch.arange(side, dtype=torch.float64) - side // 2
    angle = math.radians(angle_deg)
    across = -math.sin(angle) * place[None, :] + math.cos(angle) * place[:, None]
    return across.abs() <= HALF_WIDTH_PX


def _refined(light: Tensor, i: int) -> float:
    """Give the angle of a maximum: of the middle of what is nearly as bright around it."""
    count = light.numel()
    offsets = range(-int(3 / _STEP_DEG), int(3 / _STEP_DEG) + 1)
    near = torch.stack([light[(i + k) % count] for k in offsets])
    weight = (near - 0.8 * near.max()).clamp_min(0)
    shift = float((weight * torch.tensor(list(offsets), dtype=weight.dtype)).sum() / weight.sum())
    return ((i + shift) * _STEP_DEG) % 180


def _apart(one_deg: float, other_deg: float) -> float:
    return abs((one_deg - other_deg + 90) % 180 - 90)


def _reach(added: Tensor, angle_deg: float) -> float:
    """Give the distance at which a streak has ended, of both arms together."""
    distance = _distance(added)
    band = _near_line(added.shape[0], angle_deg)
    reach = added.shape[0] // 2
    ring = distance.round().long().clamp(max=reach + 1)
    profile = torch.zeros(reach + 2, dtype=added.dtype)
    profile.scatter_add_(0, ring[band], added[band])
    window = torch.ones(1, 1, _SMOOTH_PX, dtype=added.dtype) / _SMOOTH_PX
    smooth = torch.nn.functional.conv1d(profile[None, None, : reach + 1], window, padding="same")[
        0, 0
    ]
    start = int(2 * CORE_PX) + _SMOOTH_PX
    bright = float(smooth[start:].clamp_min(0).pow(2).sum() / smooth[start:].clamp_min(1e-30).sum())
    above = (smooth > _END * bright).nonzero().flatten()
    return float(above.max()) if above.numel() else 0.0
