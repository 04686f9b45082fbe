"""The shown picture as training wants it: at the capture's scale, without distortion.

`camkit train --pairs` undoes the distortion of a copy of the capture by itself and leaves the
capture alone; so the reference lies where the undistorted capture shows it, cut to the largest
upright rectangle that it fills.
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.calibration.display.alignment import map_places
from camkit.calibration.display.screen import Place
from camkit.colorimetry import encode_srgb
from camkit.errors import DecodeError

FloatGrid = NDArray[np.float64]

LEAST_SIDE_PX: Final = 32
INSET_PX: Final = 2
MOST_FINE: Final = 8
_TOP: Final = 255


def filled_rectangle(
    to_picture: FloatGrid, picture: tuple[int, int], size: tuple[int, int]
) -> Place:
    """Return the rectangle of the undistorted capture that a picture fills.

    Args:
        to_picture: (3, 3) places without distortion -> px of the picture.
        picture: Width and height of it.
        size: Width and height of the capture.

    Raises:
        DecodeError: If it is too small, as of a screen that stands askew.
    """
    width, height = picture
    corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1.0]])
    places = map_places(np.asarray(np.linalg.inv(to_picture)), corners)
    x, y = np.sort(places[:, 0]), np.sort(places[:, 1])
    left, top = (max(0, int(np.ceil(n[1])) + INSET_PX) for n in (x, y))
    right, bottom = (
        min(side, int(np.floor(n[2])) + 1 - INSET_PX) for n, side in zip((x, y), size, strict=True)
    )
    if min(right - left, bottom - top) < LEAST_SIDE_PX:
        raise DecodeError(
            f"of the picture an upright rectangle of {max(0, right - left)}x{max(0, bottom - top)} "
            "px is left; set the screen straight before the camera, and nearer"
        )
    return left, top, right - left, bottom - top


def reference_of(picture: FloatArray, to_picture: FloatGrid, place: Place) -> NDArray[np.uint8]:
    """Return the (h, w, 3) reference, 8-bit sRGB.

    Args:
        picture: (3, h, w) light of the picture, 0..1.
        to_picture: (3, 3) places without distortion -> px of the picture.
        place: Of the reference among those places.
    """
    left, top, width, height = place
    middle = np.array([[left + width / 2, top + height / 2]]) + np.array([[0, 0], [1, 0], [0, 1.0]])
    at = map_places(to_picture, middle)
    finer = float(np.linalg.norm(at[1:] - at[0], axis=1).max())
    # every pixel is the mean of parts of it, no coarser than those of the picture
    fine = int(np.clip(np.ceil(finer), 1, MOST_FINE))
    x, y = (
        (np.arange(side * fine) + 0.5) / fine - 0.5 + first
        for side, first in ((width, left), (height, top))
    )
    codes = np.empty((height, width, 3), dtype=np.uint8)
    band = max(1, 2_000_000 // (width * fine * fine))
    for first in range(0, height, band):
        last = min(height, first + band)
        rows = y[first * fine : last * fine]
        places = map_places(to_picture, np.stack(np.meshgrid(x, rows), axis=-1)).astype(np.float32)
        for channel, plane in enumerate(picture):
            parts = cv2.remap(
                plane,
                places[..., 0].copy(),
                places[..., 1].copy(),
                cv2.INTER_CUBIC,
                borderMode=cv2.BORDER_REPLICATE,
            )
            light = parts.reshape(last - first, fine, width, fine).mean(axis=(1, 3))
            codes[first:last, :, channel] = np.rint(_TOP * encode_srgb(light))
    return codes
