"""A picture of any range made fit for a screen: small, tone-mapped, as a JPEG beside its result.

Tones are those of F. Drago, K. Myszkowski, T. Annen, N. Chiba, "Adaptive logarithmic mapping for
displaying high contrast scenes", Computer Graphics Forum 22, 2003, as OpenCV computes them
(`createTonemapDrago`): one curve for the whole picture, between a logarithm of base 2 in the dark
and of base 10 in the light. Blocks of pixels are averaged first, so that a picture that is written
by bands is never held.
"""

from pathlib import Path
from typing import Final

import cv2
import numpy as np
from PIL import Image

from camkit.arrays import FloatArray
from camkit.colorimetry import apply_matrix
from camkit.runtime.color import ColorStage, color_stage, encode_uint8, to_rec709
from camkit.runtime.geometry.turning import turn_back
from camkit.runtime.output.dng_preview import Averages
from camkit.runtime.output.icc import icc_profile
from camkit.runtime.output.jpeg import encode_jpeg
from camkit.runtime.output.picture_writer import DEFAULT_JPEG_QUALITY
from camkit.runtime.output.preview_file import LONGEST_PREVIEW_PX

_FAINTEST: Final = 1e-7
"""Of the brightest sample; darker ones are shown as that."""
_BIAS: Final = 0.85
"""Of the operator, as its authors advise."""


class ToneMappedPreview:
    """Takes the bands of a picture and writes its preview at the end."""

    def __init__(self, height: int, width: int) -> None:
        """Prepare for a picture of a size."""
        self._averages = Averages(height, width, longest_px=LONGEST_PREVIEW_PX)

    def add(self, band: FloatArray) -> None:
        """Add the next (3, rows, w) float32 rows, linear; NaN counts as black."""
        self._averages.add(np.nan_to_num(band, nan=0.0, posinf=0.0, neginf=0.0))

    def write(self, path: Path, color: ColorStage, orientation: int) -> None:
        """Write what has come, upright.

        Args:
            path: The JPEG.
            color: What the numbers mean.
            orientation: EXIF orientation of the bands, 1..8.
        """
        light = apply_matrix(to_rec709(color), self._averages.planes())
        codes = encode_uint8(tone_mapped(np.maximum(light, 0)), tone="srgb")
        upright = np.ascontiguousarray(turn_back(codes, orientation).transpose(1, 2, 0))
        profile = icc_profile(color_stage(None), tone="srgb")
        coded = encode_jpeg(Image.fromarray(upright), quality=DEFAULT_JPEG_QUALITY, icc=profile)
        path.write_bytes(coded)


def tone_mapped(light: FloatArray) -> FloatArray:
    """Return (3, h, w) linear Rec.709 in 0..1 of light >= 0 in any range."""
    brightest = float(light.max())
    if brightest == 0:
        return light
    operator = cv2.createTonemapDrago(gamma=1.0, saturation=1.0, bias=_BIAS)
    pixels = np.maximum(light, np.float32(_FAINTEST * brightest)).transpose(1, 2, 0)
    # OpenCV takes the least sample off and divides by what is left of each pixel. One that is black
    # in all colours becomes NaN, and the picture then comes out nearly black. A row in front, with
    # one colour that is 0, keeps every pixel above that.
    padded = np.concatenate([pixels[:1], pixels]).astype(np.float32)
    padded[0, 0] = (0, padded.mean(), padded.mean())
    mapped = np.asarray(operator.process(padded), dtype=np.float32)[1:]
    return np.ascontiguousarray(mapped.transpose(2, 0, 1))
