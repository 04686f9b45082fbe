"""A lens turned about its axis, and its round part."""

from dataclasses import replace

import torch
from torch import Tensor

from camkit.models_def.optics.prescription import Lens, Surface


def turned_lens(lens: Lens, azimuth_rad: float) -> Lens:
    """Return the lens seen with a direction on the sensor turned to +y.

    Args:
        lens: The prescription.
        azimuth_rad: Of the direction, from +y towards +x.
    """
    return replace(lens, surfaces=tuple(_turned(s, azimuth_rad) for s in lens.surfaces))


def _turned(surface: Surface, azimuth_rad: float) -> Surface:
    phase, stance = surface.phase, surface.stance
    return replace(
        surface,
        phase=None if phase is None else phase.turned(azimuth_rad),
        stance=None if stance is None else stance.turned(azimuth_rad),
    )


def round_part(lens: Lens) -> Lens:
    """Return the lens without free phases, its elements where they would be centred."""
    return replace(lens, surfaces=tuple(map(_round_part, lens.surfaces)))


def _round_part(surface: Surface) -> Surface:
    phase = surface.phase
    if phase is not None:
        phase = replace(phase, free_rad=()) if phase.radial_rad else None
    return replace(surface, stance=None, phase=phase)


def turned_back(x: Tensor, y: Tensor, azimuth_rad: float | Tensor) -> tuple[Tensor, Tensor]:
    """Return points of the turned lens on the sensor as it lies; azimuths broadcast with them."""
    azimuth = torch.as_tensor(azimuth_rad, dtype=torch.float64)
    cos, sin = torch.cos(azimuth), torch.sin(azimuth)
    return cos * x + sin * y, cos * y - sin * x
