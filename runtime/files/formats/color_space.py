"""Meaning of the codes of a picture: a curve for each channel, then a matrix to Rec.709.

References: IEC 61966-2-1 (sRGB); Adobe RGB (1998) Color Image Encoding, 4.3; ITU-T H.273, tables 2
and 3 (code points of primaries and curves); SMPTE EG 432-1 (P3); ITU-R BT.2020-2.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import (
    D65,
    REC709_PRIMARIES,
    Chromaticity,
    Matrix,
    adapt_white,
    apply_matrix,
    decode_srgb,
    rgb_to_xyz,
)

FloatGrid = NDArray[np.float64]
Curve = Callable[[FloatGrid], FloatGrid]
Primaries = tuple[Chromaticity, ...]

ADOBE_RGB_PRIMARIES: Final = ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06))
ADOBE_RGB_GAMMA: Final = 563 / 256
P3_PRIMARIES: Final = ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060))
REC2020_PRIMARIES: Final = ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046))
_MATRIX_ERROR: Final = 0.012
_CURVE_ERROR: Final = 0.004
_TESTED: Final = np.linspace(0, 1, 17)


@dataclass(frozen=True, slots=True, kw_only=True)
class ColorSpace:
    """A space of curves and a matrix, or of tables that only LittleCMS knows.

    Attributes:
        name: As people read it.
        curves: Code 0..1 to light 0..1, of R, G, B, or of grey.
        to_rec709: (3, 3) from its linear RGB to linear Rec.709; of grey the unit matrix.
        tables: (h, w, 3) uint8 codes to those of sRGB, in place of curves and matrix.
    """

    name: str
    curves: tuple[Curve, ...] = ()
    to_rec709: Matrix
    tables: Callable[[NDArray[np.uint8]], NDArray[np.uint8]] | None = None

    @property
    def is_rec709(self) -> bool:
        """Return whether its primaries and white are those of Rec.709."""
        return bool(np.abs(self.to_rec709 - np.eye(3)).max() < _MATRIX_ERROR)

    @property
    def is_srgb(self) -> bool:
        """Return whether its codes are those of sRGB, within what no eye sees."""
        return self.means(SRGB)

    def means(self, other: "ColorSpace") -> bool:
        """Return whether its codes are those of a space of one curve; grey of any primaries."""
        if self.tables is not None:
            return False
        alike = np.abs(self.to_rec709 - other.to_rec709).max() < _MATRIX_ERROR
        return bool(alike or len(self.curves) == 1) and self.has_curve(other.curves[0])

    def has_curve(self, curve: Curve) -> bool:
        """Return whether every channel has a curve."""
        expected = curve(_TESTED)
        return all(
            np.abs(channel_curve(_TESTED) - expected).max() < _CURVE_ERROR
            for channel_curve in self.curves
        )

    def light_of(self, codes: NDArray[Any], top: int) -> FloatArray:
        """Convert codes to light.

        Args:
            codes: (h, w) grey or (3, h, w), unsigned integers.
            top: The code of white.

        Returns:
            Linear Rec.709 of the same shape; may leave 0..1 where the space is wider.
        """
        if self.tables is not None:
            eight = np.rint(codes * np.float32(255 / top)).astype(np.uint8)
            planes = np.stack([eight] * 3) if codes.ndim == 2 else eight
            coded = self.tables(np.ascontiguousarray(np.moveaxis(planes, 0, -1)))
            light = decode_srgb(coded.astype(np.float32) / np.float32(255))
            linear = np.ascontiguousarray(np.moveaxis(light, -1, 0))
            return linear[1] if codes.ndim == 2 else linear
        at = np.linspace(0, 1, top + 1)
        if codes.ndim == 2:
            return np.asarray(self.curves[0](at).astype(np.float32)[codes])
        curves = self.curves if len(self.curves) == 3 else self.curves * 3
        tables = [curve(at).astype(np.float32) for curve in curves]
        light = np.stack([table[plane] for table, plane in zip(tables, codes, strict=True)])
        return light if self.is_rec709 else apply_matrix(self.to_rec709, light)


def srgb_curve(codes: FloatGrid) -> FloatGrid:
    """Return light of sRGB codes in 0..1."""
    return decode_srgb(codes.astype(np.float32)).astype(np.float64)


def power_curve(gamma: float) -> Curve:
    """Return the curve of a power."""
    return lambda codes: np.asarray(np.maximum(codes, 0) ** gamma)


def matrix_to_rec709(primaries: Primaries, white: Chromaticity) -> Matrix:
    """Return the (3, 3) matrix from linear RGB of primaries to Rec.709, white kept."""
    to_xyz = adapt_white(white, D65) @ rgb_to_xyz(primaries, white)
    return np.asarray(np.linalg.inv(rgb_to_xyz(REC709_PRIMARIES, D65)) @ to_xyz)


def space_of_primaries(
    name: str, primaries: Primaries, curve: Curve, white: Chromaticity = D65
) -> ColorSpace:
    """Return the space of primaries and one curve."""
    return ColorSpace(name=name, curves=(curve,) * 3, to_rec709=matrix_to_rec709(primaries, white))


SRGB: Final = space_of_primaries("sRGB", REC709_PRIMARIES, srgb_curve)
ADOBE_RGB: Final = space_of_primaries(
    "Adobe RGB (1998)", ADOBE_RGB_PRIMARIES, power_curve(ADOBE_RGB_GAMMA)
)
CODE_POINT_PRIMARIES: Final[dict[int, tuple[str, Primaries]]] = {
    1: ("Rec.709", REC709_PRIMARIES),
    9: ("Rec.2020", REC2020_PRIMARIES),
    12: ("Display P3", P3_PRIMARIES),
}
CODE_POINT_CURVES: Final[dict[int, tuple[str, Curve]]] = {
    4: ("gamma 2.2", power_curve(2.2)),
    8: ("linear", power_curve(1.0)),
    13: ("sRGB", srgb_curve),
}
