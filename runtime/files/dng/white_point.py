"""The white balance and the colour matrix of a DNG, from its tags.

AsShotNeutral    what a grey gives in the camera: its gains are the inverse
AsShotWhiteXY    the light's chromaticity; the colour matrix of that light says what grey gives

camera = AnalogBalance * CameraCalibration * ColorMatrix * XYZ, the matrices of two lights mixed by
the inverse of the light's correlated colour temperature (DNG specification 1.7.1, chapter 6).
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.colorimetry import Chromaticity, white_xyz
from camkit.runtime.files.tiff_tags import TiffTags

AS_SHOT_NEUTRAL: Final = 50728
AS_SHOT_WHITE_XY: Final = 50729
ANALOG_BALANCE: Final = 50727
SIGNATURES: Final = (50931, 50932)
"""Of the camera's calibration and of the profile; the calibration holds if they are the same."""
LIGHTS: Final = ((50721, 50723, 50778), (50722, 50724, 50779))
"""ColorMatrix, CameraCalibration, CalibrationIlluminant."""
_THIRD_LIGHT: Final = (52529, 52530, 52531)
MAX_FACTOR: Final = 1e3
"""Of a colour matrix or a balance that a camera can have."""

# EXIF LightSource -> correlated colour temperature in kelvin (Exif 2.32, DNG 1.7)
_ILLUMINANT_KELVIN: Final = {
    1: 5500, 2: 3800, 3: 2856, 4: 5500, 9: 5500, 10: 6500, 11: 7500, 12: 6400, 13: 5050, 14: 4150,
    15: 3525, 17: 2856, 18: 4874, 19: 6774, 20: 5503, 21: 6504, 22: 7504, 23: 5003, 24: 3200,
}  # fmt: skip
_D65_KELVIN: Final = 6504

Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LightMatrix:
    """XYZ to camera under one light.

    Attributes:
        matrix: (3, 3) with calibration and balance.
        light: EXIF number of the light; 0 if not stated.
    """

    matrix: Matrix
    light: int

    @property
    def kelvin(self) -> int:
        """Return the colour temperature of the light; 0 if it is not known."""
        return _ILLUMINANT_KELVIN.get(self.light, 0)


def light_matrices(tags: TiffTags) -> list[LightMatrix]:
    """Return the believable colour matrices of a DNG, one of each light."""
    balance = np.array(tags.numbers(ANALOG_BALANCE) or (1.0, 1.0, 1.0))
    if balance.shape != (3,) or not ((balance > 0) & (balance < MAX_FACTOR)).all():
        balance = np.ones(3)
    signed = [tags.text(tag) or "" for tag in SIGNATURES]
    matrices = []
    for matrix_tag, calibration_tag, light_tag in LIGHTS:
        matrix = _square(tags, matrix_tag)
        if matrix is None:
            continue
        calibration = _square(tags, calibration_tag) if signed[0] == signed[1] else None
        if calibration is not None:
            matrix = calibration @ matrix
        light = (tags.numbers(light_tag) or (0,))[0]
        matrices.append(
            LightMatrix(
                matrix=balance[:, None] * matrix, light=int(light) if math.isfinite(light) else 0
            )
        )
    return matrices


def color_matrix(tags: TiffTags) -> tuple[Matrix, str | None] | None:
    """Return the DNG colour matrix (XYZ to camera) whose light is nearest to D65, and a note.

    Returns:
        The (3, 3) matrix with AnalogBalance and CameraCalibration applied, and a note if its light
        is not D65 or the file has a third light; None if the file has no believable matrix.
    """
    matrices = light_matrices(tags)
    if not matrices:
        return None
    one = min(matrices, key=lambda each: abs(each.kelvin - _D65_KELVIN))
    if abs(np.linalg.det(one.matrix)) < 1e-9:
        return None
    source = f"EXIF light source {one.light}" if one.light else "an unknown light source"
    is_d65 = one.kelvin == _D65_KELVIN
    notes = [] if is_d65 else [f"the colour matrix is for {source}, not D65: colours may be off"]
    if any(tags.numbers(tag) is not None for tag in _THIRD_LIGHT):
        notes.append("ColorMatrix3, of a third light, is not applied")
    return one.matrix, "; ".join(notes) or None


def neutral(tags: TiffTags) -> NDArray[np.float64] | None:
    """Return (3,) camera values of a grey in the light of the photograph; None if not stated."""
    values = np.array(tags.numbers(AS_SHOT_NEUTRAL) or ())
    if values.shape == (3,) and np.isfinite(values).all() and values.min() > 0:
        return values
    place = tags.numbers(AS_SHOT_WHITE_XY) or ()
    if len(place) != 2 or not (min(place) > 0 and sum(place) < 1):
        return None
    light = place[0], place[1]
    matrix = _mixed(light_matrices(tags), light)
    if matrix is None:
        return None
    grey = matrix @ white_xyz(light)
    return grey if np.isfinite(grey).all() and grey.min() > 0 else None


def colour_temperature_k(light: Chromaticity) -> float:
    """Return the correlated colour temperature: that of the nearest black body, 1000 to 25000 K.

    References: CIE 15:2004, section 9.5 (nearest in u, v of 1960); the locus by Krystek 1985, good
    to 1e-4 up to 15000 K.
    """
    x, y = light
    u, v = 4 * x / (12 * y - 2 * x + 3), 6 * y / (12 * y - 2 * x + 3)
    t = 1e6 / np.linspace(40, 1000, 9601)
    locus_u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t**2) / (
        1 + 8.42420235e-4 * t + 7.08145163e-7 * t**2
    )
    locus_v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t**2) / (
        1 - 2.89741816e-5 * t + 1.61456053e-7 * t**2
    )
    return float(t[np.argmin((locus_u - u) ** 2 + (locus_v - v) ** 2)])


def _mixed(matrices: list[LightMatrix], light: Chromaticity) -> Matrix | None:
    """Return the matrix of a light, between those of two others by inverse temperature."""
    ordered = sorted((m for m in matrices if m.kelvin), key=lambda m: m.kelvin)
    if len(ordered) < 2 or ordered[0].kelvin == ordered[1].kelvin:
        return matrices[0].matrix if matrices else None
    warm, cold = ordered
    inverse = 1 / colour_temperature_k(light)
    part = (1 / warm.kelvin - inverse) / (1 / warm.kelvin - 1 / cold.kelvin)
    part = min(max(part, 0.0), 1.0)
    return (1 - part) * warm.matrix + part * cold.matrix


def _square(tags: TiffTags, tag: int) -> Matrix | None:
    values = tags.numbers(tag)
    if values is None or len(values) != 9 or not (np.abs(values) < MAX_FACTOR).all():
        return None
    return np.array(values, dtype=np.float64).reshape(3, 3)
