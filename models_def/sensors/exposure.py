"""Light recorded by a sensor, behind a mosaic or in planes: photons, read noise, clipping, DN."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.bundle.sensor import ColorSensor
from camkit.models_def.sensors.demosaic import mosaic


def expose(
    light: Tensor,
    gains: tuple[float, float, float],
    sensor: ColorSensor,
    iso: float,
    rng: np.random.Generator,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Record light as a mosaic, or as planes where the sensor has none.

    Args:
        light: (1, 3, h, w) white-balanced camera space, >= 0.
        gains: White balance (R, G, B); a colour clips at its gain.
        sensor: Pattern or none, levels and noise.
        iso: Sensitivity.
        rng: Source of the noise.

    Returns:
        (h, w) float32, (3, h, w) of planes, black 0 and white 1; and where it clipped, likewise.
    """
    noise = sensor.noise_at(iso)
    raw = light / torch.tensor(gains).reshape(1, 3, 1, 1)
    samples = raw if sensor.cfa is None else mosaic(raw, sensor.cfa)
    signal = samples[0].numpy().astype(np.float64)
    recorded = rng.poisson(signal / noise.shot[0]) * noise.shot[0]
    recorded += rng.standard_normal(signal.shape, dtype=np.float32) * noise.read_variance[0] ** 0.5
    levels = sensor.white_level - sensor.black_level
    dn = np.clip(np.rint(recorded * levels), -sensor.black_level, levels)
    return (dn / levels).astype(np.float32), dn >= levels
