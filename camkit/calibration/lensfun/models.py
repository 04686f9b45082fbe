"""lensfun's models of radial distortion: their formulas, and the same as powers of the radius.

With the ideal radius r and the radius d in the picture, both in units of half the shorter side of
the picture in which the lens was measured:

    ptlens   d = a r^4 + b r^3 + c r^2 + (1 - a - b - c) r
    poly3    d = k1 r^3 + (1 - k1) r
    poly5    d = k2 r^5 + k1 r^3 + r

Each is a polynomial, so nothing is lost where it becomes `RadialEntry`.

References: lensfun manual, "Lens distortion models" (group of lfDistortionModel).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from camkit.bundle.optics import RadialEntry
from camkit.errors import DecodeError

FloatGrid = NDArray[np.float64]
TERMS: Final[Mapping[str, tuple[str, ...]]] = {
    "ptlens": ("a", "b", "c"),
    "poly3": ("k1",),
    "poly5": ("k1", "k2"),
}
FULL_FRAME_MM: Final = math.hypot(36.0, 24.0)
"""Diagonal to which crop factors refer."""
USUAL_ASPECT: Final = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Distortion:
    """An entry of distortion.

    Attributes:
        model: ptlens, poly3 or poly5.
        focal_mm: Focal length for which it was measured.
        terms: Its numbers, in the order of `TERMS`.
    """

    model: str
    focal_mm: float
    terms: tuple[float, ...]

    def captured_radius(self, r: FloatGrid) -> FloatGrid:
        """Return the radius in the picture of ideal radii, by lensfun's own formula."""
        return _FORMULAS[self.model](r, *self.terms)

    def to_radial(self, radius_mm: float, channels: int, scale: float = 1.0) -> RadialEntry:
        """Return the same as powers, for every channel.

        Args:
            radius_mm: What lensfun's unit is on the sensor; see `unit_mm`.
            channels: Of the sensor.
            scale: By which ideal radii are multiplied first; below 1 the straight picture grows.

        Raises:
            DecodeError: If its numbers are larger than a bundle may hold.
        """
        if self.model == "ptlens":
            a, b, c = self.terms
            odd, even = (1 - a - b - c, b, 0.0, 0.0), (c, a, 0.0)
        elif self.model == "poly3":
            (k1,) = self.terms
            odd, even = (1 - k1, k1, 0.0, 0.0), None
        else:
            k1, k2 = self.terms
            odd, even = (1.0, k1, k2, 0.0), None
        a0, a1, a2, a3 = (a * scale**power for a, power in zip(odd, (1, 3, 5, 7), strict=True))
        if even is not None:
            b0, b1, b2 = (b * scale**power for b, power in zip(even, (2, 4, 6), strict=True))
        try:
            return RadialEntry(
                coefficients=((a0, a1, a2, a3),) * channels,
                even_coefficients=None if even is None else ((b0, b1, b2),) * channels,
                radius_mm=radius_mm,
            )
        except ValidationError as error:
            raise DecodeError(
                f"no bundle holds the {self.model} at {self.focal_mm:g} mm: its numbers are too "
                f"large at a scale of {scale:g}"
            ) from error


def _ptlens(r: FloatGrid, a: float, b: float, c: float) -> FloatGrid:
    return np.asarray(r * (a * r**3 + b * r**2 + c * r + (1 - a - b - c)))


def _poly3(r: FloatGrid, k1: float) -> FloatGrid:
    return np.asarray(r * (1 - k1 + k1 * r**2))


def _poly5(r: FloatGrid, k1: float, k2: float) -> FloatGrid:
    return np.asarray(r * (1 + k1 * r**2 + k2 * r**4))


_FORMULAS: Final[Mapping[str, Callable[..., FloatGrid]]] = {
    "ptlens": _ptlens,
    "poly3": _poly3,
    "poly5": _poly5,
}


def unit_mm(crop_factor: float, aspect: float) -> float:
    """Return the unit of distortion, half the shorter side of the measured picture, in mm.

    Args:
        crop_factor: Of the camera with which the lens was measured.
        aspect: Longer over shorter side of its pictures.
    """
    return corner_mm(crop_factor) / math.hypot(1.0, aspect)


def corner_mm(crop_factor: float) -> float:
    """Return the unit of vignetting, half the diagonal of the measured picture, in mm."""
    return FULL_FRAME_MM / 2 / crop_factor


@dataclass(frozen=True, slots=True, kw_only=True)
class Vignetting:
    """An entry of vignetting, light = 1 + k1 r^2 + k2 r^4 + k3 r^6, 1 at the corner measured.

    Attributes:
        focal_mm: Focal length.
        aperture: F-number.
        distance_m: Of the object.
        terms: k1, k2, k3.
    References: lensfun manual, "Lens vignetting model" (pa, of PTLens and Hugin).
    """

    focal_mm: float
    aperture: float
    distance_m: float
    terms: tuple[float, float, float]

    def light(self, r: FloatGrid) -> FloatGrid:
        """Return relative illumination at radii in units of half the diagonal."""
        k1, k2, k3 = self.terms
        u = r * r
        return np.asarray(1 + u * (k1 + u * (k2 + u * k3)))
