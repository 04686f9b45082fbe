"""Photons counted: Poisson noise, and what a network is told of it.

    light -- N photons of white -- Poisson --> counts --> light again, and 3 sigma of every pixel

With c counts, d of them dark on average, the light is (c - d) / N. Its deviation is sqrt(c) / N;
that of a count of 0 is not 0, so one photon is added: 3 sqrt(c + 1) / N, without dark counts
3 sqrt((y + 1/N) / N).
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.errors import ContractError

NOISE_DEVIATIONS: Final = 3.0
"""Deviations in the plane that tells a network of noise."""
FAINT: Final = 1e-4
"""Light below which the slope of its deviation is no longer followed."""

Generator = np.random.Generator


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposure:
    """The number of photons of an exposure.

    Attributes:
        photons: That reach a pixel which sees white; inf for no noise.
        detected: Share of them that are counted.
        dark_counts: Of a pixel, without light.
    """

    photons: float
    detected: float = 1.0
    dark_counts: float = 0.0

    def __post_init__(self) -> None:
        if not self.photons > 0 or not 0 < self.detected <= 1:
            raise ContractError(
                f"photons must be > 0, detected in (0, 1]; got {self.photons}, {self.detected}"
            )
        if not (math.isfinite(self.dark_counts) and self.dark_counts >= 0):
            raise ContractError(f"dark_counts must be a number >= 0; got {self.dark_counts}")

    @property
    def white_counts(self) -> float:
        """Counts of a pixel that sees white, dark ones left out: N."""
        return self.photons * self.detected

    def brighter(self, factor: float) -> "Exposure":
        """Return the same exposure of a pixel that collects so many times the light."""
        return Exposure(
            photons=self.photons * factor, detected=self.detected, dark_counts=self.dark_counts
        )


def draw_counts(light: Tensor, exposure: Exposure, rng: Generator) -> Tensor:
    """Draw the counts of light (..., h, w), 1 = white; float32.

    Raises:
        ContractError: If there are infinitely many photons, or light is negative.
    """
    if math.isinf(exposure.photons):
        raise ContractError("counts need a finite number of photons; got inf")
    if (light < 0).any():
        raise ContractError(f"light must be >= 0 to be counted; got {float(light.min()):g}")
    mean = light.double().numpy() * exposure.white_counts + exposure.dark_counts
    return torch.from_numpy(rng.poisson(mean).astype(np.float32))


def told_planes(counts: Tensor, exposure: Exposure) -> Tensor:
    """Return light and noise (b, 2, h, w) of counts (b, 1, h, w); see the head of the module."""
    white = exposure.white_counts
    light = (counts - exposure.dark_counts) / white
    return torch.cat([light, NOISE_DEVIATIONS * torch.sqrt(counts + 1) / white], dim=1)


def expose(light: Tensor, exposure: Exposure, rng: Generator) -> Tensor:
    """Count light (b, 1, h, w) and return it with its noise, (b, 2, h, w).

    With infinitely many photons light comes back as it is, and its noise is 0.
    """
    if math.isinf(exposure.photons):
        return torch.cat([light, torch.zeros_like(light)], dim=1)
    return told_planes(draw_counts(light, exposure, rng), exposure)


def count_softly(light: Tensor, photons: Tensor, generator: torch.Generator) -> Tensor:
    """Count light so that gradients pass.

    Counts are true Poisson ones; their deviation from the mean follows the square root of the
    light, as the noise of brighter light is larger.

    Args:
        light: (b, 1, h, w) >= 0.
        photons: (b, 1, 1, 1) of white.
        generator: Source of the noise.

    Returns:
        (b, 1, h, w) counts over photons.
    """
    detached = light.detach().clamp(min=0)
    counts = torch.poisson(detached * photons, generator=generator)
    root = torch.sqrt(light.clamp(min=FAINT))
    gap = (counts / photons - detached) / root.detach()
    return light + gap * root
