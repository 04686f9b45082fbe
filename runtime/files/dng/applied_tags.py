"""Effect of the tags of a DNG on decoded samples: levels, black of every pixel, gains, and notes.

samples + tags -> black_map, masked_black, white_levels, field_gains -> Correction -> samples
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.cfa import CfaPattern
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files.dng.corrections import Correction
from camkit.runtime.files.dng.dng_levels import BlackMap, black_map, white_levels
from camkit.runtime.files.dng.masked_areas import masked_black
from camkit.runtime.files.dng.opcodes import field_gains
from camkit.runtime.files.dng.picture_tags import DngPicture
from camkit.runtime.files.raw_checks import Levels


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenPixels:
    """Visible samples of a DNG before its tags are applied.

    Attributes:
        samples: (h, w) mosaic or (plane, h, w); planes may be one seen several times.
        cfa: Pattern at the first visible pixel; None for planes.
        whole: (h, w) or (h, w, plane) of the whole sensor, masked pixels too.
        first: Row and column of the first visible pixel on it.
    """

    samples: NDArray[Any]
    cfa: CfaPattern | None
    whole: NDArray[Any]
    first: tuple[int, int]


def apply_tags(
    picture: DngPicture, pixels: SeenPixels, options: MosaicOptions, decoded: Levels | None = None
) -> tuple[NDArray[Any], Levels, list[str]]:
    """Return samples and levels as the tags of the DNG ask for, and notes.

    Args:
        picture: The sensor picture.
        pixels: Its decoded samples.
        options: Levels that the caller says in place of the file's.
        decoded: Levels where the decoder made other numbers of the samples; None for the tags'.
    """
    top, left, bottom, right = picture.active_area
    height, width = pixels.samples.shape[-2:]
    offset = pixels.first[0] - top, pixels.first[1] - left
    if min(offset) < 0 or offset[0] + height > bottom - top or offset[1] + width > right - left:
        offset = 0, 0  # LibRaw shows another area, as it does for some cameras
    repeated = pixels.samples.ndim == 3 and picture.planes == 1
    samples = pixels.samples[:1] if repeated else pixels.samples
    black, notes = _black(picture, pixels, options, decoded, offset)
    whites = white_levels(picture)
    if decoded is not None:
        whites = np.full(picture.planes, decoded.white, dtype=np.float32)
    if options.white_level is not None:
        whites = np.full_like(whites, options.white_level)
    gains, gain_notes = field_gains(picture)
    correction = Correction(black=black, gains=gains, whites=whites, cfa=pixels.cfa, offset=offset)
    levels = Levels(black=black.mean(mosaic=pixels.cfa is not None), white=float(whites.max()))
    if correction and levels.black.max() < whites.min():
        samples, levels = correction.apply(samples)
    if repeated:
        samples = np.broadcast_to(samples, pixels.samples.shape)
        levels = replace(levels, black=np.repeat(levels.black, len(samples)))
    return samples, levels, notes + gain_notes


def _black(
    picture: DngPicture,
    pixels: SeenPixels,
    options: MosaicOptions,
    decoded: Levels | None,
    offset: tuple[int, int],
) -> tuple[BlackMap, list[str]]:
    """Return black of every pixel: said, as the decoder has it, measured, or as the tags state."""
    height, width = pixels.samples.shape[-2:]
    flat = BlackMap(
        pattern=np.zeros((1, 1, picture.planes)), columns=np.zeros(width), rows=np.zeros(height)
    )
    if options.black_level is not None:
        return replace(flat, pattern=flat.pattern + options.black_level), []
    if decoded is not None:
        return replace(flat, pattern=_as_pattern(decoded.black, picture.planes)), []
    black, notes = black_map(picture, (height, width), offset)
    if not black.is_of_cells:
        return black, notes
    mean_black, white = (
        black.mean(mosaic=pixels.cfa is not None),
        float(white_levels(picture).max()),
    )
    measured, more = masked_black(picture, pixels.whole, mean_black, white, pixels.first)
    return replace(black, pattern=_as_pattern(measured, picture.planes)), notes + more


def _as_pattern(black: NDArray[Any], planes: int) -> NDArray[np.float64]:
    """Return (r, c, plane) of levels by cell, or by plane."""
    levels = black.astype(np.float64)
    return levels[..., None] if levels.ndim == 2 else levels[None, None, :planes]
