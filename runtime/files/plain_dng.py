"""A DNG whose samples are read without LibRaw: area, pattern and levels from its tags."""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.cfa import CFA_PATTERNS
from camkit.errors import DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files import raw_checks
from camkit.runtime.files.dng import dng_checks
from camkit.runtime.files.dng.applied_tags import SeenPixels, apply_tags
from camkit.runtime.files.dng.picture_tags import DngPicture, numbers_of
from camkit.runtime.files.dng.plain_samples import read_plain
from camkit.runtime.files.exif_tags import metadata_of
from camkit.runtime.files.raw_decode import RawDecode, stated_orientation
from camkit.runtime.files.raw_tags import UNIQUE_CAMERA_MODEL
from camkit.runtime.files.tiff_tags import TiffTags

LINEARIZATION: Final = 50712


def plain_decode(
    path: Path, tags: TiffTags, picture: DngPicture, options: MosaicOptions
) -> RawDecode:
    """Read a DNG of floats, of deflated samples or of planes that lie apart.

    Args:
        path: The file.
        tags: Of the file.
        picture: Its sensor picture, which `check_readable` has passed.
        options: Levels that the caller says in place of the file's.

    Raises:
        DecodeError: If its data are damaged.
        OSError: If the file cannot be read.
    """
    cfa = next((cfa for cfa in CFA_PATTERNS if cfa == picture.pattern), None)
    raw_checks.check_size(picture.height, picture.width, tags.file_bytes)
    dng_checks.check_layout(picture)
    whole = _linear(read_plain(path, picture), picture)
    top, left, bottom, right = picture.active_area
    visible = whole[top:bottom, left:right]
    raw_checks.check_size(bottom - top, right - left, tags.file_bytes)
    notes = []
    samples: NDArray[Any]
    if cfa is not None:
        samples = visible[..., 0]
    elif picture.planes == 1:
        notes.append("monochrome sensor: its plane is used as red, green and blue")
        samples = np.broadcast_to(visible[..., 0], (3, *visible.shape[:2]))
    else:
        notes.append("linear RGB file: already demosaicked, so demosaicking is skipped")
        samples = np.moveaxis(visible, -1, 0)
    pixels = SeenPixels(samples=samples, cfa=cfa, whole=whole, first=(top, left))
    samples, levels, more = apply_tags(picture, pixels, options)
    if picture.is_float:
        notes.insert(
            0, f"floating-point DNG: samples are used as stored, white is {levels.white:g}"
        )
    metadata = metadata_of(tags)
    return RawDecode(
        samples=samples,
        cfa=cfa,
        levels=levels,
        orientation=stated_orientation(tags) or 1,
        metadata=metadata
        if metadata.camera
        else metadata.completed(model=tags.text(UNIQUE_CAMERA_MODEL)),
        notes=notes + more,
    )


def _linear(whole: NDArray[Any], picture: DngPicture) -> NDArray[Any]:
    """Return samples behind the LinearizationTable, if there is one for them."""
    table = np.array(numbers_of(picture.directory, LINEARIZATION))
    if not table.size or whole.dtype.kind == "f":
        return whole
    if not (
        np.isfinite(table).all() and table.min() >= 0 and table.max() <= np.iinfo(np.uint16).max
    ):
        raise DecodeError("the table that makes light of the samples is damaged")
    return np.asarray(table.astype(np.uint16)[np.minimum(whole, table.size - 1)])
