"""Exposure of a sensor with a mosaic, with gradients: eq. (5.2) of the thesis.

Twin of `camkit.models_def.sensors.exposure.expose`, with photons as Gaussian noise and without
rounding. Clipped samples pass no gradient on: a design must not learn from light that the sensor
cannot see.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from camkit.cfa import CfaPattern
from camkit.models_def.sensors.demosaic import demosaic, mosaic


@dataclass(frozen=True, slots=True, kw_only=True)
class Pixels:
    """The sensor.

    Attributes:
        cfa: Its colours.
        gains: White balance (R, G, B); a colour clips at its gain.
    """

    cfa: CfaPattern
    gains: tuple[float, float, float]


def recorded(
    light: Tensor, pixels: Pixels, *, shot: Tensor, read_variance: Tensor, normal: Tensor
) -> Tensor:
    """Record light and develop it.

    Args:
        light: (b, 3, h, w) white-balanced camera space, >= 0.
        pixels: The sensor.
        shot: (b,) variance per unit of signal.
        read_variance: (b,) at zero signal.
        normal: (b, h, w) standard normal numbers.

    Returns:
        (b, 3, h, w) white-balanced planes as captured; noise may be negative.

    References: Sun 2021, eq. (5.2).
    """
    gains = torch.tensor(pixels.gains).reshape(1, 3, 1, 1)
    signal = mosaic(light / gains, pixels.cfa)
    variance = shot[:, None, None] * signal.detach().clamp(min=0) + read_variance[:, None, None]
    samples = (signal + variance.sqrt() * normal).clamp(max=1)
    factors = mosaic(gains.expand(1, 3, *samples.shape[1:]), pixels.cfa)
    return demosaic(samples * factors, pixels.cfa)


def whole_kernels(light: Tensor) -> Tensor:
    """Return kernels (c, n, n) of sum 1: light that leaves the window lies over it as even haze.

    Left out it would be an absorber, which no plate is, and a design would darken lamps with it.
    """
    missing = 1 - light.sum((-2, -1), keepdim=True)
    return light + missing / light.shape[-1] ** 2
