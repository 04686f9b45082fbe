"""Places of a picture that are shown at 100 %: chosen, or named by the caller."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.color import encode_uint8
from camkit.runtime.geometry.shrink import shrunk

CROP_PX: Final = (640, 480)
"""Width and height."""
WHOLE_PX: Final = 1280
"""Longest side of the whole picture."""
_LOOKED_PX: Final = 8
"""Side of the squares whose means are compared."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Crop:
    """A part of a picture.

    Attributes:
        name: What it is.
        left, top: Of its first pixel.
        width, height: In pixels of the picture.
        step: Pixels of the picture along a side of a pixel that is shown.
    """

    name: str
    left: int
    top: int
    width: int
    height: int
    step: int = 1

    def of(self, light: FloatArray) -> FloatArray:
        """Return this part of a picture (3, h, w)."""
        rows = slice(self.top, self.top + self.height)
        columns = slice(self.left, self.left + self.width)
        return shrunk(light[:, rows, columns], self.step)


def choose_crops(
    after: FloatArray, before: FloatArray | None, centres: Sequence[tuple[int, int]]
) -> list[Crop]:
    """Return the whole picture, and the parts that are shown at 100 %.

    A picture that is shown whole at 100 % has no chosen parts.

    Args:
        after: (3, h, w) of the result.
        before: The same of the capture; None where it is unknown.
        centres: (x, y) of the parts that the caller names.

    Raises:
        ContractError: If a centre lies outside.
    """
    _, height, width = after.shape
    step = min(-(-max(height, width) // WHOLE_PX), height, width)
    name = "Whole picture" + ("" if step == 1 else f", 1 : {step}")
    crops = [Crop(name=name, left=0, top=0, width=width, height=height, step=step)]
    if step > 1:
        crops.append(_crop_at("Middle", width // 2, height // 2, after.shape))
        if before is not None:
            crops.append(_crop_at("Strongest change", *_changed(after, before), after.shape))
        crops.append(_crop_at("Brightest light", *_brightest(after), after.shape))
    for x, y in centres:
        if not (0 <= x < width and 0 <= y < height):
            raise ContractError(
                f"{option_text('crops')} {x},{y} lies outside the picture of {width} x {height} px"
            )
        crops.append(_crop_at(f"At {x}, {y}", x, y, after.shape))
    return crops


def _crop_at(name: str, x: int, y: int, shape: tuple[int, ...]) -> Crop:
    height, width = shape[1:]
    across, down = min(CROP_PX[0], width), min(CROP_PX[1], height)
    left = min(max(x - across // 2, 0), width - across)
    top = min(max(y - down // 2, 0), height - down)
    return Crop(name=name, left=left, top=top, width=across, height=down)


def _brightest(light: FloatArray) -> tuple[int, int]:
    """Return (x, y) of the brightest sample."""
    place = int(light.max(axis=0).argmax())
    y, x = divmod(place, light.shape[2])
    return x, y


def _changed(after: FloatArray, before: FloatArray) -> tuple[int, int]:
    """Return (x, y) of the middle of the crop whose codes differ most.

    Clipped light differs whatever was done, so only codes below white count.
    """
    codes = [encode_uint8(picture, tone="srgb").max(axis=0) for picture in (after, before)]
    difference = cv2.absdiff(*codes)
    difference[(codes[0] == np.iinfo(np.uint8).max) | (codes[1] == np.iinfo(np.uint8).max)] = 0
    height, width = difference.shape
    size = (max(1, width // _LOOKED_PX), max(1, height // _LOOKED_PX))
    coarse = cv2.resize(difference.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    window = (max(1, CROP_PX[0] // _LOOKED_PX), max(1, CROP_PX[1] // _LOOKED_PX))
    mean = cv2.blur(coarse, window, borderType=cv2.BORDER_CONSTANT)
    y, x = divmod(int(mean.argmax()), size[0])
    return x * _LOOKED_PX, y * _LOOKED_PX
