"""Shares of a plate's light in core, streaks and haze, and the place of the streaks."""

import math
from dataclasses import dataclass, replace
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
_FAINTEST: Final = 1e-4
"""Of the light; what is fainter is none even where nothing is brighter."""
_MOST: Final = 16
_TURNS: Final = 4
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
        bare: (side, side), shares of the light of the lens without the plate, whose own halo is
            no streak.

    Raises:
        ContractError: If the two are no PSFs of one odd side.
    """
    added = _added(psf, bare)
    distance = _distance(added)
    centre = added.shape[0] // 2
    usable = (distance > 2 * CORE_PX) & (distance <= centre)
    rest = torch.where(usable, added, torch.zeros_like(added))
    angles = torch.arange(0, 180, _STEP_DEG, dtype=torch.float64).tolist()
    bands = [_near_line(added.shape[0], angle) for angle in angles]
    streaks: list[Streak] = []
    brightest = 0.0
    for _ in range(_MOST):
        light = torch.stack([rest[band].sum() for band in bands])
        excess = light - light.median()
        brightest = max(brightest, float(excess.max()))
        if float(excess.max()) <= max(_LEAST * brightest, _FAINTEST):
            break
        angle = _refined(rest, angles[int(light.argmax())])
        streaks.append(Streak(angle_deg=angle, reach_px=_reach(added, angle)))
        # beside it a line still meets its inner part
        rest = torch.where(_near_line(added.shape[0], angle, 3.0), torch.zeros_like(rest), rest)
    return tuple(streaks)


def with_reach(streaks: tuple[Streak, ...], psf: Tensor, bare: Tensor) -> tuple[Streak, ...]:
    """Return streaks as far as they reach in another colour; see `find_streaks`."""
    added = _added(psf, bare)
    return tuple(replace(one, reach_px=_reach(added, one.angle_deg)) for one in streaks)


def side_for(psf: Tensor, share: float) -> int:
    """Return the least odd side around the middle that holds a share of the light; all at most.

    Args:
        psf: (..., side, side), each a PSF; all must be held.
        share: Of the light of the aperture.
    """
    side = psf.shape[-1]
    for side_px in range(1, side, 2):
        cut = (side - side_px) // 2
        inner = psf[..., cut : cut + side_px, cut : cut + side_px]
        if float(inner.sum((-2, -1)).min()) >= share:
            return side_px
    return side


def shares(psf: Tensor, streaks: tuple[Streak, ...]) -> Shares:
    """Compute the shares of a PSF in core, streaks and haze.

    Args:
        psf: (side, side), shares of the light.
        streaks: Of this PSF, see `find_streaks`.
    """
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
    """Return the distance of every pixel from the middle."""
    place = torch.arange(psf.shape[0], dtype=torch.float64) - psf.shape[0] // 2
    return (place[:, None] ** 2 + place[None, :] ** 2).sqrt()


def _near_line(side: int, angle_deg: float, widths: float = 1.0) -> Tensor:
    place = torch.arange(side, dtype=torch.float64) - side // 2
    angle = math.radians(angle_deg)
    distance_px = -math.sin(angle) * place[None, :] + math.cos(angle) * place[:, None]
    return distance_px.abs() <= widths * HALF_WIDTH_PX


def _refined(added: Tensor, angle_deg: float) -> float:
    """Return the angle of the axis about which light near a line has the least moment."""
    light = torch.where(_distance(added) > 4 * CORE_PX, added, torch.zeros_like(added))
    place = torch.arange(added.shape[0], dtype=torch.float64) - added.shape[0] // 2
    for _ in range(_TURNS):
        near = torch.where(
            _near_line(added.shape[0], angle_deg, 2.0), light.clamp_min(0), torch.zeros_like(light)
        )
        xx = float((near.sum(0) * place**2).sum())
        yy = float((near.sum(1) * place**2).sum())
        xy = float((near * place[:, None] * place[None, :]).sum())
        if xx + yy == 0:
            break
        angle_deg = math.degrees(math.atan2(2 * xy, xx - yy) / 2)
    return round(angle_deg, 3) % 180


def _reach(added: Tensor, angle_deg: float) -> float:
    """Return the distance at which a streak has ended, of both arms together."""
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
    bright_px = (smooth > _END * bright).nonzero().flatten()
    return float(bright_px.max()) if bright_px.numel() else 0.0
