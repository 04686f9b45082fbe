"""A photograph of a board as one grey plane, whatever kind of file it is.

Corners are places where four squares meet; any brightness that grows with light shows them in the
same place. So samples become the square root of light, in which noise is about even. In a mosaic
every 2x2 cell holds the three colours: weights of 1, 2, 1 along both axes take each site of a cell
with the same weight at every pixel, so that no pattern of colours is left and nothing is moved.
"""

from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import DecodeError
from camkit.regular_file import check_regular
from camkit.runtime.files.picture import read_scene
from camkit.runtime.raw import is_picture, read_capture

LEAST_SIDE_PX: Final = 48
DARKEST, BRIGHTEST = 0.5, 99.5
"""Percentiles between which 8 bits are spread."""
_CELL: Final = np.array([0.25, 0.5, 0.25])


def read_grey(path: Path) -> FloatArray:
    """Read a picture or RAW file.

    Returns:
        (h, w) float32 in the orientation of the sensor, the square root of light.

    Raises:
        DecodeError: If the file cannot be read, or is too small for a board.
    """
    light = _read_light(path)
    if min(light.shape) < LEAST_SIDE_PX:
        raise DecodeError(
            f"{path.name}: {light.shape[1]}x{light.shape[0]} px are too few for a board; expected "
            f"{LEAST_SIDE_PX} px or more on either side"
        )
    return np.sqrt(np.maximum(light, 0))


def _read_light(path: Path) -> FloatArray:
    try:
        check_regular(path)
        picture = is_picture(path)
    except OSError as error:
        raise DecodeError(f"cannot read {path}: {error.strerror or error}") from error
    except DecodeError as error:
        raise DecodeError(f"{path}: {error}") from error
    if picture:
        return np.asarray(read_scene(path).mean(axis=0))
    capture = read_capture(path)
    light = capture.linear_rows(0, capture.height)
    if not np.isfinite(light).all():
        raise DecodeError(f"{path.name}: samples are NaN or infinite; a picture must be finite")
    if capture.cfa is None:
        return np.asarray(light.mean(axis=0))
    return np.asarray(cv2.sepFilter2D(light, -1, _CELL, _CELL), dtype=np.float32)


def to_codes(grey: FloatArray) -> NDArray[np.uint8]:
    """Scale a plane to 8 bits, as detectors ask for."""
    low, high = np.percentile(grey, (DARKEST, BRIGHTEST))
    spread = (grey - low) * (255 / max(float(high - low), 1e-12))
    return np.asarray(np.clip(np.rint(spread), 0, 255), dtype=np.uint8)
