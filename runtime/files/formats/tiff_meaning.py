"""Samples of a TIFF to grey or RGB, as its photometric interpretation says.

References: TIFF 6.0, sections 4 (MinIsWhite), 5 (palettes), 18 (alpha), 23 (CIELab); CIE 15 (Lab);
Adobe Photoshop TIFF technical notes (ICCLab). Lab without a WhitePoint is of D50, as in libtiff.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import (
    D65,
    REC709_PRIMARIES,
    adapt_white,
    apply_matrix,
    rgb_to_xyz,
    white_xyz,
)
from camkit.errors import DecodeError
from camkit.runtime.files.formats.icc_profile import PCS_WHITE
from camkit.runtime.files.formats.tiff_page import (
    ASSOCIATED_ALPHA,
    CIE_LAB,
    ICC_LAB,
    MIN_IS_BLACK,
    MIN_IS_WHITE,
    PALETTE,
    TiffPage,
)

_COLOR_MAP: Final = 320
_WHITE_POINT: Final = 318
_LAB_EDGE: Final = 6 / 29


def to_grey_or_rgb(samples: NDArray[Any], page: TiffPage) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Return (h, w) or (3, h, w), and notes.

    Args:
        samples: (sample, h, w) as stored, unsigned integers or float32.
        page: Where they come from.

    Raises:
        DecodeError: If a palette is damaged.
    """
    notes = []
    if samples.shape[0] > page.colours:
        premultiplied = page.extra[:1] == (ASSOCIATED_ALPHA,)
        notes.append("alpha channel dropped" + ("; colours stay multiplied by it" * premultiplied))
    colours = samples[: page.colours]
    match page.photometric:
        case _ if page.photometric == MIN_IS_WHITE:
            top = colours.dtype.type((1 << page.bits) - 1)
            return top - colours[0], (*notes, "MinIsWhite: samples are inverted")
        case _ if page.photometric == PALETTE:
            return _looked_up(colours[0], page), tuple(notes)
        case _ if page.photometric == MIN_IS_BLACK and page.colours == 3:
            notes.append("three grey samples per pixel are read as R, G, B")
    return colours[0] if page.colours == 1 else np.ascontiguousarray(colours), tuple(notes)


def _looked_up(indices: NDArray[Any], page: TiffPage) -> NDArray[np.uint8]:
    size = 1 << page.bits
    entries = page.numbers(_COLOR_MAP)
    if len(entries) != 3 * size:
        raise DecodeError(
            f"a palette of {page.bits} bits has {3 * size} entries; got {len(entries)}"
        )
    table = np.array(entries).reshape(3, size)
    # some writers fill the 16 bits of an entry with 8
    eight = table >> 8 if table.max() > 255 else table
    return np.ascontiguousarray(eight.astype(np.uint8)[:, indices])


def is_lab(page: TiffPage) -> bool:
    """Return whether samples are Lab."""
    return page.photometric in (CIE_LAB, ICC_LAB)


def light_of_lab(samples: NDArray[Any], page: TiffPage) -> FloatArray:
    """Convert (3, h, w) unsigned codes of Lab to linear Rec.709.

    Lightness takes the whole range of the codes; a and b are signed in CIELab and shifted by half
    the range in ICCLab.
    """
    full = (1 << page.bits) - 1
    step = 1 << (page.bits - 8)
    lightness = samples[0].astype(np.float32) * np.float32(100 / full)
    if page.photometric == CIE_LAB:
        signed = samples[1:3].view(np.int8 if page.bits == 8 else np.int16).astype(np.float32)
    else:
        signed = samples[1:3].astype(np.float32) - np.float32(128 * step)
    a, b = signed / np.float32(step)
    y = (lightness + 16) / 116
    roots = np.stack([y + a / 500, y, y - b / 200])
    edge = np.float32(_LAB_EDGE)
    relative = np.where(roots > edge, roots**3, 3 * edge**2 * (roots - np.float32(4 / 29)))
    white_point = page.tags.get(_WHITE_POINT)
    white = PCS_WHITE
    if isinstance(white_point, tuple) and len(white_point) == 2 and min(white_point) > 0:
        white = (float(white_point[0]), float(white_point[1]))
    to_rec709 = np.linalg.inv(rgb_to_xyz(REC709_PRIMARIES, D65)) @ adapt_white(white, D65)
    return apply_matrix(to_rec709 @ np.diag(white_xyz(white)), relative.astype(np.float32))
