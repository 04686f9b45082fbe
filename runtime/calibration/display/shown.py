"""Pictures that are to be shown: light of Rec.709, upright, whatever profile their file embeds."""

from pathlib import Path
from typing import Final

import numpy as np

from camkit.colorimetry import D65, REC709_PRIMARIES, apply_matrix, rgb_to_xyz
from camkit.contracts import FloatArray
from camkit.errors import DecodeError
from camkit.regular_file import check_regular
from camkit.runtime.calibration.display.profile import (
    ADOBE_RGB_GAMMA,
    ADOBE_RGB_PRIMARIES,
    Space,
    space_of,
)
from camkit.runtime.capture import Capture
from camkit.runtime.files.picture import read_orientation, read_picture, read_scene
from camkit.runtime.geometry.turning import turn
from camkit.runtime.raw import is_picture

LEAST_SIDE_PX: Final = 16


def read_shown(path: Path) -> tuple[FloatArray, Space]:
    """Read a picture to be shown.

    Returns:
        (3, h, w) linear Rec.709, 0..1 where the display can show it, and the space of the file.

    Raises:
        DecodeError: If it cannot be read, is a RAW file, is too small, or embeds another profile
            than sRGB or Adobe RGB.
    """
    try:
        check_regular(path)
        if not is_picture(path):
            raise DecodeError("no picture; expected PNG, JPEG, TIFF or EXR")  # noqa: TRY301
    except OSError as error:
        raise DecodeError(f"cannot read {path}: {error.strerror or error}") from error
    except DecodeError as error:
        raise DecodeError(f"{path.name}: {error}") from error
    space, light = space_of(path), read_scene(path)
    coded = _codes(path)
    if coded is None and space != "sRGB":
        raise DecodeError(f"{path.name} is grey, but of {space}; save it in colour or as sRGB")
    if coded is not None and space == "Adobe RGB":
        if np.issubdtype(coded.samples.dtype, np.floating):
            raise DecodeError(
                f"{path.name} is of floats, but its profile is of codes; save 16 bits"
            )
        codes = coded.samples.astype(np.float32) / np.float32(coded.white_level)
        light = from_adobe_rgb(codes)
    if min(light.shape[1:]) < LEAST_SIDE_PX:
        raise DecodeError(
            f"{path.name}: {light.shape[2]}x{light.shape[1]} px are too few to be shown; expected "
            f"{LEAST_SIDE_PX} or more on either side"
        )
    return np.ascontiguousarray(turn(light, read_orientation(path))), space


def _codes(path: Path) -> Capture | None:
    """Give the picture as it is coded; None for a grey one, which `read_scene` knows alone."""
    try:
        return read_picture(path, keep_codes=True)
    except DecodeError:
        return None


def from_adobe_rgb(codes: FloatArray) -> FloatArray:
    """Give (3, h, w) linear Rec.709 of Adobe RGB codes in 0..1; may leave 0..1.

    References: Adobe RGB (1998) Color Image Encoding, 4.3.
    """
    to_rec709 = np.linalg.inv(rgb_to_xyz(REC709_PRIMARIES, D65)) @ rgb_to_xyz(
        ADOBE_RGB_PRIMARIES, D65
    )
    return apply_matrix(to_rec709, codes ** np.float32(ADOBE_RGB_GAMMA))
