"""Colour spaces and tone curves that both flows agree on: Rec.709, ACEScg, camera space.

Matrices act on columns: `xyz = RGB_TO_XYZ @ rgb`. Sources: ITU-R BT.709-6 (primaries, D65),
IEC 61966-2-1 (sRGB curve), Academy S-2014-004 (AP1 primaries, ACES white), Bradford matrix from
Lam 1985 as given in ICC.1:2022 Annex E; camera matrices as in the DNG specification 1.7, ch. 6.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError

Matrix = NDArray[np.float64]
Chromaticity = tuple[float, float]

D65: Final[Chromaticity] = (0.3127, 0.3290)
ACES_WHITE: Final[Chromaticity] = (0.32168, 0.33767)
REC709_PRIMARIES: Final = ((0.640, 0.330), (0.300, 0.600), (0.150, 0.060))
ACESCG_PRIMARIES: Final = ((0.713, 0.293), (0.165, 0.830), (0.128, 0.044))
LUMA: Final[FloatArray] = np.array([0.299, 0.587, 0.114], np.float32)
BRADFORD: Final[Matrix] = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def white_xyz(white: Chromaticity) -> Matrix:
    """Return XYZ of a white point, Y = 1."""
    x, y = white
    return np.array([x / y, 1.0, (1.0 - x - y) / y])


def rgb_to_xyz(primaries: tuple[Chromaticity, ...], white: Chromaticity) -> Matrix:
    """Return the (3, 3) matrix from linear RGB to XYZ for the primaries and white point.

    Primaries may lie outside all colours, with y of 0 as those of XYZ itself; the white may not.
    """
    columns = np.array([(x, y, 1.0 - x - y) for x, y in primaries]).T
    scale = np.linalg.solve(columns, white_xyz(white))
    return np.asarray(columns * scale)


def rec709_of_light(light: Chromaticity) -> Matrix:
    """Return the (3,) linear Rec.709 values of a light of luminance 1; D65 has (1, 1, 1)."""
    return np.asarray(np.linalg.solve(rgb_to_xyz(REC709_PRIMARIES, D65), white_xyz(light)))


def adapt_white(source: Chromaticity, target: Chromaticity) -> Matrix:
    """Return the Bradford (3, 3) XYZ matrix that maps the source white on the target white."""
    gains = (BRADFORD @ white_xyz(target)) / (BRADFORD @ white_xyz(source))
    return np.asarray(np.linalg.inv(BRADFORD) @ np.diag(gains) @ BRADFORD)


def rec709_to_acescg() -> Matrix:
    """Return the (3, 3) matrix from linear Rec.709 (D65) to ACEScg, adapted by Bradford."""
    to_xyz = rgb_to_xyz(REC709_PRIMARIES, D65)
    from_xyz = np.linalg.inv(rgb_to_xyz(ACESCG_PRIMARIES, ACES_WHITE))
    return np.asarray(from_xyz @ adapt_white(D65, ACES_WHITE) @ to_xyz)


def camera_from_rec709(color_matrix: Matrix) -> tuple[Matrix, tuple[float, float, float]]:
    """Return the camera space of a neutral-preserving camera and its white balance.

    Args:
        color_matrix: (3, 3) XYZ (D65) to camera, as the DNG tag ColorMatrix for D65.

    Returns:
        matrix: (3, 3) from linear Rec.709 to white-balanced camera RGB; rows sum to 1, so that
            grey stays grey. Its inverse is the colour stage of the pipeline.
        white_balance: Gains (R, G, B) that make the raw response to D65 neutral, G = 1.

    Raises:
        ContractError: If the matrix is singular or makes white non-positive.
    """
    if color_matrix.shape != (3, 3) or not np.isfinite(color_matrix).all():
        raise ContractError(f"color matrix must be finite (3, 3); got {color_matrix.shape}")
    raw = color_matrix @ rgb_to_xyz(REC709_PRIMARIES, D65)
    neutral = raw.sum(axis=1)
    if (neutral <= 0).any() or abs(np.linalg.det(raw)) < 1e-9:
        raise ContractError("color matrix is singular or gives a white that is not positive")
    gains = neutral[1] / neutral
    return raw / neutral[:, None], (float(gains[0]), 1.0, float(gains[2]))


def rec709_from_camera(color_matrix: Matrix) -> Matrix:
    """Return the (3, 3) matrix from white-balanced camera RGB to linear Rec.709.

    Raises:
        ContractError: As `camera_from_rec709`, whose inverse this is.
    """
    return np.asarray(np.linalg.inv(camera_from_rec709(color_matrix)[0]), dtype=np.float64)


def encode_srgb(linear: FloatArray) -> FloatArray:
    """Apply the sRGB curve to a linear signal; clipped to 0..1 first."""
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055).astype(np.float32)


def decode_srgb(encoded: FloatArray) -> FloatArray:
    """Undo the sRGB curve for values in 0..1."""
    x = np.clip(encoded, 0.0, 1.0)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4).astype(np.float32)


def luma(encoded: FloatArray) -> FloatArray:
    """Return 0.299 R + 0.587 G + 0.114 B (h, w) of sRGB-coded planes (3, h, w), full range."""
    return np.asarray(np.tensordot(LUMA, encoded, axes=1), np.float32)


def apply_matrix(matrix: Matrix, planes: FloatArray) -> FloatArray:
    """Return matrix @ planes for (3, ...) float32 planes."""
    flat = matrix.astype(np.float32) @ planes.reshape(3, -1)
    return np.asarray(flat.reshape(planes.shape), dtype=np.float32)


class OutputColours:
    """Camera colours (3, n) as the output has them, and back; the way back is computed once."""

    def __init__(self, to_output: Matrix) -> None:
        """Invert the matrix.

        Args:
            to_output: (3, 3) from camera colours to those of the output.
        """
        self._there = to_output.astype(np.float32)
        self._back = np.linalg.inv(to_output).astype(np.float32)

    def of(self, light: FloatArray) -> FloatArray:
        """Return light (3, n) in the colours of the output."""
        return _turned(light, self._there)

    def raised(self, light: FloatArray, least: FloatArray) -> FloatArray:
        """Return camera colours (3, n) that are raised to a least light in those of the output.

        Args:
            light: Camera colours; those bright enough keep their bits.
            least: (3, n) or (n,) in colours of the output.
        """
        output_light = self.of(light)
        short = (output_light < least).any(axis=0)
        out = light.copy()
        out[:, short] = _turned(np.maximum(output_light, least)[:, short], self._back)
        return out


def _turned(light: FloatArray, matrix: FloatArray) -> FloatArray:
    """Multiply (3, n) light; a product of matrices may differ in a last bit with n."""
    return np.stack([sum(a * plane for a, plane in zip(row, light, strict=True)) for row in matrix])
