"""Exposure by a sensor: photons, electrons, full well, amplifier, converter.

References: Foi et al. 2008; EMVA 1288 release 4.0, ch. 2.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.sensor import BayerSensor, ColorSensor
from camkit.cfa import CfaPattern, cfa_channels
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.geometry.illumination import illumination_band
from camkit.runtime.twin.light import Gains, Light

NOISE_ROWS: Final = 256
MOST_BITS: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """The camera settings of an exposure.

    Attributes:
        iso: Sensitivity; sets the gain and the noise.
        exposure: Factor on the light.
        seed: Seed of the noise; the same seed gives the same capture.
        noise: Apply shot and read noise.
        noise_factor: Factor on the deviation of all noise, which the file does not state.
        bits: Of the converter; None for the sensor's.
    """

    iso: float = 100.0
    exposure: float = 1.0
    seed: int = 0
    noise: bool = True
    noise_factor: float = 1.0
    bits: int | None = None

    def __post_init__(self) -> None:
        if not (self.iso > 0 and np.isfinite(self.iso)):
            raise ContractError(f"iso must be > 0; got {self.iso}")
        if self.bits is not None and not 1 <= self.bits <= MOST_BITS:
            raise ContractError(f"a converter has 1 to {MOST_BITS} bits; got {self.bits}")
        if self.seed < 0:
            raise ContractError(f"seed must be >= 0; got {self.seed}")
        if not (self.exposure > 0 and np.isfinite(self.exposure)):
            raise ContractError(f"exposure must be > 0; got {self.exposure}")


def expose(light: Light, sensor: ColorSensor, setting: Setting) -> NDArray[np.uint16]:
    """Return the DN that a sensor records of light.

    Args:
        light: What falls on it.
        sensor: Mosaic or planes, levels, full well and noise per ISO.
        setting: Sensitivity, seed, noise.

    Returns:
        (h, w) of a mosaic, (c, h, w) of planes.
    """
    signal = signal_of(light, sensor)
    rng = np.random.default_rng(setting.seed) if setting.noise else None
    noise = noise_of(sensor, setting)
    # Fewer, larger electrons give the larger noise; the well then holds as much light as before.
    well_e = sensor.full_well_e / setting.noise_factor**2
    black, white = levels_of(sensor, setting)
    dn = np.empty(signal.shape, dtype=np.uint16)
    for top in range(0, signal.shape[-2], NOISE_ROWS):
        rows = np.s_[..., top : top + NOISE_ROWS, :]
        exposed = signal[rows].astype(np.float64)
        if setting.exposure != 1:
            exposed *= setting.exposure
        recorded = record(exposed, noise, well_e, rng)
        levels = black + recorded * (white - black)
        dn[rows] = np.clip(np.rint(levels), 0, np.floor(white))
    return dn


def noise_of(sensor: ColorSensor, setting: Setting) -> NoiseModel:
    """Return the noise that a setting really makes."""
    noise = sensor.noise_at(setting.iso)
    power = setting.noise_factor**2
    return NoiseModel(
        shot=tuple(shot * power for shot in noise.shot),
        read_variance=tuple(read * power for read in noise.read_variance),
    )


def levels_of(sensor: ColorSensor, setting: Setting) -> tuple[float, float]:
    """Return black and white level of the converter; with other bits the black keeps its share."""
    if setting.bits is None:
        return sensor.black_level, sensor.white_level
    white = 2.0**setting.bits - 1
    return float(np.rint(sensor.black_level * white / sensor.white_level)), white


def variance_of(signal: NDArray[np.float64], noise: NoiseModel, step: float) -> NDArray[np.float64]:
    """Return the variance of samples: photons, amplifier, converter.

    Args:
        signal: Without noise, 1.0 = white level; what lies below 0 counts as dark.
        noise: At the ISO, alike in all channels.
        step: Of the converter, in the same unit.
    References: EMVA 1288 release 4.0, eq. (15) with the converter's variance of step^2 / 12.
    """
    middle = len(noise.shot) // 2
    dark = noise.read_variance[middle] + step * step / 12
    return np.asarray(noise.shot[middle] * np.maximum(signal, 0) + dark)


def record(
    signal: NDArray[np.float64],
    noise: NoiseModel,
    full_well_e: float,
    rng: np.random.Generator | None,
) -> NDArray[np.float64]:
    """Return the signal after the pixel: Poisson electrons, full well, Gaussian read noise.

    Args:
        signal: Linear, 1.0 = white level.
        noise: Noise at the ISO; `shot` is the signal of one electron, alike in all channels.
        full_well_e: Electrons that a pixel holds.
        rng: Random generator, or None for no noise.
    """
    middle = len(noise.shot) // 2
    per_electron = noise.shot[middle]
    electrons = signal / per_electron
    if rng is None:
        return np.minimum(electrons, full_well_e) * per_electron
    read_e = np.sqrt(noise.read_variance[middle]) / per_electron
    counted = np.minimum(rng.poisson(electrons), full_well_e)
    return np.asarray((counted + read_e * rng.standard_normal(signal.shape)) * per_electron)


def sample_mosaic(planes: FloatArray, cfa: CfaPattern, gains: Gains) -> FloatArray:
    """Return the (h, w) raw mosaic of (3, h, w) white-balanced planes."""
    mosaic = np.empty(planes.shape[1:], dtype=np.float32)
    for row, channels in enumerate(cfa_channels(cfa)):
        for column, channel in enumerate(channels):
            site = slice(row, None, 2), slice(column, None, 2)
            mosaic[site] = planes[channel][site] * np.float32(1 / gains[channel])
    return mosaic


def sample_planes(planes: FloatArray, sensor: ColorSensor, gains: Gains) -> FloatArray:
    """Return the samples of (c, h, w) white-balanced planes: (h, w) behind a mosaic."""
    if isinstance(sensor, BayerSensor):
        return sample_mosaic(planes, sensor.cfa, gains)
    return planes / np.array(gains, dtype=np.float32)[:, None, None]


def signal_of(light: Light, sensor: ColorSensor) -> FloatArray:
    """Return the signal of the pixels, 1.0 = white level, dimmed by the optics."""
    signal = sample_planes(light.planes, sensor, light.gains)
    if light.vignetting is not None:
        height = light.window.size_px[1]
        for top in range(0, height, NOISE_ROWS):
            bottom = min(top + NOISE_ROWS, height)
            signal[..., top:bottom, :] *= illumination_band(
                light.vignetting, light.window, top, bottom
            )
    return signal
