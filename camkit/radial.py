"""Distortion and illumination of a lens of revolution: functions of the distance from its axis.

Sensor positions are in millimetres from the optical axis, +x to the right and +y down the rows;
the axis lies at the picture centre ((w - 1) / 2, (h - 1) / 2) of the full sensor unless its
extent states another `optical_centre_px`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class RadialDistortion:
    """Radial distortion per channel: r_d = xi r (1 + k1 r^2 + k2 r^4 + k3 r^6) + even powers.

    Attributes:
        coefficients: (channel, 4) float64; xi * (1, k1, k2, k3), for radii in units of
            `radius_mm`. r is the ideal (undistorted) radius, r_d the radius on the sensor.
        radius_mm: The unit of r and r_d: half the diagonal of the sensor.
        even_coefficients: (channel, 3) float64; b of b0 r^2 + b1 r^4 + b2 r^6, which models of
            measured lenses have besides; None for none.
    References: Sun 2021, eq. (6.10) and (6.11).
    """

    coefficients: NDArray[np.float64]
    radius_mm: float
    even_coefficients: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        shape = self.coefficients.shape
        if (
            len(shape) != 2
            or shape[1] != 4
            or not shape[0]
            or not np.isfinite(self.coefficients).all()
        ):
            raise ContractError(f"distortion needs finite (channel, 4) coefficients; got {shape}")
        even = self.even_coefficients
        if even is not None and (even.shape != (shape[0], 3) or not np.isfinite(even).all()):
            raise ContractError(
                f"even powers of distortion need finite ({shape[0]}, 3) coefficients; got "
                f"{even.shape}"
            )
        if not (np.isfinite(self.radius_mm) and self.radius_mm > 0):
            raise ContractError(f"distortion radius_mm must be > 0; got {self.radius_mm}")

    def row(self, channel: int) -> NDArray[np.float64]:
        """Return the coefficients of a channel: (4,), or (7,) with those of even powers behind."""
        if self.even_coefficients is None:
            return np.asarray(self.coefficients[channel])
        return np.concatenate([self.coefficients[channel], self.even_coefficients[channel]])


@dataclass(frozen=True, slots=True, kw_only=True)
class RadialIllumination:
    """Relative illumination over the distance from the optical axis.

    Attributes:
        heights_mm: (n,) float64, increasing from 0.
        light: (n,) float64 > 0, 1 on the axis; between heights linear in their square, constant
            beyond the last.
    """

    heights_mm: NDArray[np.float64]
    light: NDArray[np.float64]

    def __post_init__(self) -> None:
        heights, light = self.heights_mm, self.light
        if heights.ndim != 1 or not heights.size or heights.shape != light.shape:
            raise ContractError(
                f"illumination needs one value for each height; got {light.shape}, {heights.shape}"
            )
        if heights[0] != 0 or not np.isfinite(heights).all() or (np.diff(heights) <= 0).any():
            raise ContractError("heights of illumination must increase from 0")
        if not ((light > 0) & np.isfinite(light)).all():
            raise ContractError("relative illumination needs finite values > 0")
