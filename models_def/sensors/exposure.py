"""Light recorded by a sensor with a mosaic: photons, read noise, clipping, digital numbers."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.bundle.sensor import BayerSensor
from camkit.models_def.sensors.demosaic import mosaic


def expose(
    light: Tensor,
    gains: tuple[float, float, float],
    sensor: BayerSensor,
    iso: float,
    rng: np.random.Generator,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Record light as a mosaic.

    Args:
        light: (1, 3, h, w) white-balanced camera space, >= 0.
        gains: White balance (R, G, B); a colour clips at its gain.
        sensor: Pattern, levels and noise.
        iso: Sensitivity.
        rng: Source of the noise.

    Returns:
        (h, w) float32, black 0 and white 1, and (h, w) where it clipped.
    """
    noise = sensor.noise_at(iso)
    raw = light / torch.tensor(gains).reshape(1, 3, 1, 1)
    signal = mosaic(raw, sensor.cfa)[0].numpy().astype(np.float64)
    recorded = rng.poisson(signal / noise.shot[0]) * noise.shot[0]
    recorded += rng.standard_normal(signal.shape, dtype=np.float32) * noise.read_variance[0] ** 0.5
    levels = sensor.white_level - sensor.black_level
    dn = np.clip(np.rint(recorded * levels), -sensor.black_level, levels)
    return (dn / levels).astype(np.float32), dn >= levels
