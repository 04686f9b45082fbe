"""The share of a point's light that lies near its peak, and the standard error of that share.

A wrong black level moves all samples alike. In a wide PSF, an error of a tenth of a DN matters more
than all the noise.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.calibration.lattice import FloatGrid
from camkit.runtime.capture import Capture
from camkit.units import UM_PER_MM

PEAK_PX: Final = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """A place of the sensor at which a PSF was measured.

    Attributes:
        height_mm: Of the light from the middle of the sensor.
        peak_share: Of its green light within the kernel, what lies within 10 px of the peak.
        peak_share_error: Its standard error, by noise and by the level of black.
    """

    height_mm: float
    peak_share: float
    peak_share_error: float

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "height_mm": round(self.height_mm, 4),
            "peak_share": round(self.peak_share, 5),
            "peak_share_error": float(f"{self.peak_share_error:.3g}"),
        }


def height_mm(like: Capture, centre_px: tuple[float, float], pitch_um: float) -> float:
    """Return the distance of a place from the middle of the sensor.

    Args:
        like: A frame, which may state that it is a part of a sensor.
        centre_px: (x, y) in it.
        pitch_um: Of its pixels.
    """
    size, origin = (like.width, like.height), (0, 0)
    if like.origin_px is not None and like.sensor_size_px is not None:
        size, origin = like.sensor_size_px, like.origin_px
    x, y = (at + first - (n - 1) / 2 for at, first, n in zip(centre_px, origin, size, strict=True))
    return float(np.hypot(x, y)) * pitch_um / UM_PER_MM


def peak_share(
    light: FloatGrid, variance: FloatGrid, level_error: float, pitch_px: float = 1.0
) -> tuple[float, float]:
    """Return the share of light within 10 px of the middle, and its standard error.

    Args:
        light: (side, side), background taken off and nothing cut: what is cut at zero is a bias.
        variance: Of its noise.
        level_error: Standard error of the background, the same for all samples.
        pitch_px: Of the samples between which both were interpolated, so that they are not
            independent.
    """
    offset = np.arange(light.shape[-1]) - light.shape[-1] // 2
    near = np.hypot(offset[:, None], offset[None]) <= PEAK_PX
    total, peak = float(light.sum()), float(light[near].sum())
    share = peak / total
    inner, outer = (pitch_px**2 * float(variance[part].sum()) for part in (near, ~near))
    noise = np.sqrt((1 - share) ** 2 * inner + share**2 * outer)
    black = level_error * abs(np.count_nonzero(near) - share * light.size)
    return share, float(np.hypot(noise, black)) / total


def light_within(kernel: FloatArray) -> FloatGrid:
    """Return the light of a kernel (n, n) within 0.5, 1.5, ... px of its middle."""
    offset = np.arange(kernel.shape[-1]) - kernel.shape[-1] // 2
    ring = np.rint(np.hypot(offset[:, None], offset)).astype(np.intp)
    return np.asarray(np.cumsum(np.bincount(ring.ravel(), kernel.astype(np.float64).ravel())))
