"""Pictures to judge on: L = 0.299 R + 0.587 G + 0.114 B of sRGB-coded values, full range.

A picture is cut to whole pixels of the array at its right and lower border.
"""

from pathlib import Path
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.colorimetry import encode_srgb, luma
from camkit.report.quality import list_set, read_picture
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.scenes import procedural_scene

SCENES: Final = 4
FIRST_SEED: Final = 40
"""Golden cases and probes have others."""


def coded_luminance(linear: FloatArray) -> FloatArray:
    """Return L (h, w) of a linear Rec.709 picture (3, h, w); what exceeds white is white."""
    return luma(encode_srgb(linear))


def whole_pixels(picture: FloatArray, scale: int) -> FloatArray:
    """Cut a picture (h, w) to whole pixels of scale x scale."""
    height, width = (side // scale * scale for side in picture.shape)
    return np.ascontiguousarray(picture[:height, :width])


def read_pictures(folder: Path, count: int | None, scale: int) -> tuple[FloatArray, ...]:
    """Read the first pictures of a folder by name.

    Raises:
        ContractError: If there is none.
        DecodeError: If one is damaged; names it.
    """
    lights = (coded_luminance(read_picture(path)) for path in list_set(folder, count))
    return tuple(whole_pixels(picture, scale) for picture in lights)


def drawn_pictures(camera: FineCamera, count: int | None) -> tuple[FloatArray, ...]:
    """Draw procedural scenes of the size of an array's fine grid; four unless asked."""
    sensor, scale = camera.sensor, camera.scale
    height, width = scale * sensor.height_px, scale * sensor.width_px
    seeds = range(FIRST_SEED, FIRST_SEED + (count or SCENES))
    return tuple(coded_luminance(procedural_scene(seed, height, width)) for seed in seeds)
