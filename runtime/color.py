"""Camera colour to output colour: matrix, exposure, highlights, and the coding of 16-bit files.

The camera space is white-balanced (grey has equal channels); its matrix is the inverse of
`camkit.colorimetry.camera_from_rec709`, so grey stays grey.
"""

from dataclasses import dataclass
from functools import cache
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import (
    ACES_WHITE,
    ACESCG_PRIMARIES,
    D65,
    REC709_PRIMARIES,
    Chromaticity,
    Matrix,
    adapt_white,
    apply_matrix,
    rec709_from_camera,
    rec709_to_acescg,
    rgb_to_xyz,
)
from camkit.errors import ContractError

OutputColor = Literal["rec709", "acescg", "camera"]
Primaries = tuple[Chromaticity, Chromaticity, Chromaticity]

# A channel counts as clipped from this fraction of its clipping level on, fully at the second.
CLIP_START: Final = 0.90
CLIP_FULL: Final = 0.99
SRGB_TABLE_BITS: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class ColorStage:
    """The last step of the pipeline: one matrix and what the numbers then mean.

    Attributes:
        space: Name of the output space.
        matrix: (3, 3) white-balanced camera RGB -> output RGB, exposure included.
        primaries: Chromaticities of R, G, B. Those of "camera" follow from the colour matrix and
            may be imaginary.
        white: Chromaticity of equal RGB.
    """

    space: OutputColor
    matrix: Matrix
    primaries: Primaries
    white: Chromaticity


def color_stage(
    color_matrix: Matrix | None, output: OutputColor = "rec709", *, exposure_ev: float = 0.0
) -> ColorStage:
    """Build the colour stage of a capture.

    Args:
        color_matrix: (3, 3) XYZ (D65) to camera; None for pictures that are Rec.709 already.
        output: Output space.
        exposure_ev: Factor 2**exposure_ev on the picture.

    Raises:
        ContractError: If the space is unknown or the matrix is singular.
    """
    if output not in get_args(OutputColor):
        names = ", ".join(get_args(OutputColor))
        raise ContractError(f"colour must be one of {names}; got {output!r}")
    to_rec709 = rec709_of_planes(color_matrix)
    primaries: Primaries = REC709_PRIMARIES
    white, matrix = D65, to_rec709
    if output == "acescg":
        primaries, white = ACESCG_PRIMARIES, ACES_WHITE
        matrix = rec709_to_acescg() @ to_rec709
    elif output == "camera":
        primaries = _chromaticities(rgb_to_xyz(REC709_PRIMARIES, D65) @ to_rec709)
        matrix = np.eye(3)
    gain = 2.0**exposure_ev
    return ColorStage(space=output, matrix=matrix * gain, primaries=primaries, white=white)


def rec709_of_planes(color_matrix: Matrix | None) -> Matrix:
    """Return the (3, 3) matrix from white-balanced planes to linear Rec.709.

    Args:
        color_matrix: (3, 3) XYZ (D65) to camera; None for planes that are Rec.709 already.

    Raises:
        ContractError: If the matrix is singular.
    """
    return np.eye(3) if color_matrix is None else rec709_from_camera(color_matrix)


def to_output(band: FloatArray, stage: ColorStage) -> FloatArray:
    """Return a (3, rows, w) band of camera RGB in the output space; negatives are kept."""
    return apply_matrix(stage.matrix, band)


def to_rec709(stage: ColorStage) -> Matrix:
    """Return the (3, 3) matrix from the output space to Rec.709, white kept."""
    to_xyz = adapt_white(stage.white, D65) @ rgb_to_xyz(stage.primaries, stage.white)
    return np.asarray(np.linalg.inv(rgb_to_xyz(REC709_PRIMARIES, D65)) @ to_xyz)


def recover_highlights(
    band: FloatArray, clip_levels: tuple[float, float, float], *, in_place: bool = False
) -> FloatArray:
    """Raise clipped channels so that burnt-out light is neutral, never magenta.

    After white balance the channels clip at different levels, so an overexposed white has too
    little green. A clipped channel is raised to the mean of the other two, where another clipped
    channel stands for the brightest one: a grey ramp stays grey right up to the last channel
    that clips, a red lamp stays red, and nothing is ever lowered.

    Args:
        band: (3, rows, w) float32, white-balanced camera RGB.
        clip_levels: Value at which each channel clips: its white balance gain.
        in_place: Whether the band itself is changed.

    Returns:
        (3, rows, w) float32; the band itself where nothing is clipped.
    """
    levels = np.array(clip_levels, dtype=np.float32)
    near = band[0] > CLIP_START * levels[0]
    for channel in (1, 2):
        near |= band[channel] > CLIP_START * levels[channel]
    if not near.any():
        return band
    x = band[:, near]
    start = CLIP_START * levels[:, None]
    clipped = np.clip((x - start) / ((CLIP_FULL - CLIP_START) * levels[:, None]), 0.0, 1.0)
    assumed = x + clipped * (x.max(axis=0) - x)
    raised = np.empty_like(x)
    for channel in range(3):
        others = 0.5 * (assumed[(channel + 1) % 3] + assumed[(channel + 2) % 3])
        lift = clipped[channel] * (others - x[channel])
        raised[channel] = x[channel] + np.maximum(lift, 0.0)
    out = band if in_place else band.copy()
    out[:, near] = raised
    return out


@cache
def _srgb_table() -> NDArray[np.uint16]:
    # Over the square root of the signal the sRGB curve is nearly straight: 16 bits of table err
    # by less than one code of 16 bits.
    linear = np.linspace(0.0, 1.0, 2**SRGB_TABLE_BITS) ** 2
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(encoded * 65535), dtype=np.uint16)


def encode_uint16(band: FloatArray, *, tone: Literal["srgb", "linear"]) -> NDArray[np.uint16]:
    """Return 16-bit codes of a linear band, 1.0 = 65535; values outside 0..1 are clipped.

    Args:
        band: (c, rows, w) float32, linear.
        tone: The sRGB curve (IEC 61966-2-1) or none.
    """
    x = np.clip(band, 0.0, 1.0)
    if tone == "linear":
        return np.asarray(np.rint(x * np.float32(65535)), dtype=np.uint16)
    np.sqrt(x, out=x)
    x *= np.float32(2**SRGB_TABLE_BITS - 1)
    return np.asarray(_srgb_table()[np.rint(x, out=x).astype(np.uint16)])


def encode_uint8(band: FloatArray, *, tone: Literal["srgb", "linear"]) -> NDArray[np.uint8]:
    """Return 8-bit codes of a linear band, 1.0 = 255; values outside 0..1 are clipped."""
    codes = encode_uint16(band, tone=tone).astype(np.uint32)
    return ((codes + 128) // 257).astype(np.uint8)


def _chromaticities(to_xyz: Matrix) -> Primaries:
    red, green, blue = ((float(c[0] / c.sum()), float(c[1] / c.sum())) for c in to_xyz.T)
    return red, green, blue
