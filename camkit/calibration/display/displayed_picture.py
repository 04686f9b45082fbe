"""Pictures that are to be shown: light of Rec.709, upright, whatever profile their file embeds."""

from pathlib import Path
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import DecodeError
from camkit.regular_file import check_regular
from camkit.runtime.files.formats.color_space import ADOBE_RGB, SRGB
from camkit.runtime.files.picture import read_orientation, read_scene_and_space
from camkit.runtime.geometry.turning import turn
from camkit.runtime.raw import is_picture

LEAST_SIDE_PX: Final = 16
_SPACES: Final = {"sRGB": SRGB, "Adobe RGB": ADOBE_RGB}


def read_shown(path: Path) -> tuple[FloatArray, str]:
    """Read a picture to be shown.

    Returns:
        (3, h, w) linear Rec.709, 0..1 where the display can show it, and the name of the colour
        space of the file.

    Raises:
        DecodeError: If it cannot be read, is a RAW file, is too small, or states a colour space
            that cannot be honoured.
    """
    try:
        check_regular(path)
        if not is_picture(path):
            raise DecodeError("no picture; expected PNG, JPEG, TIFF or EXR")  # noqa: TRY301
        light, space = read_scene_and_space(path)
        orientation = read_orientation(path)
    except OSError as error:
        raise DecodeError(f"cannot read {path}: {error.strerror or error}") from error
    except DecodeError as error:
        has_name = path.name in str(error)
        raise DecodeError(str(error) if has_name else f"{path.name}: {error}") from error
    if min(light.shape[1:]) < LEAST_SIDE_PX:
        raise DecodeError(
            f"{path.name}: {light.shape[2]}x{light.shape[1]} px are too few to be shown; expected "
            f"{LEAST_SIDE_PX} or more on either side"
        )
    name = next(
        (name for name, known_space in _SPACES.items() if space.means(known_space)), space.name
    )
    return np.ascontiguousarray(turn(light, orientation)), name
