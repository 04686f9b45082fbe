"""A capture as grey light on a small lattice, and where each sample lies without distortion."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.calibration.display.camera_file import Illumination, Lens
from camkit.cfa import cfa_channels
from camkit.errors import DecodeError
from camkit.runtime.capture import Capture
from camkit.runtime.merging.merge import clipped_rows
from camkit.runtime.merging.survey import read_frame, without_pixels

FloatGrid = NDArray[np.float64]

WORK_PX: Final = 1600
"""Longer side of the lattice at most."""
_CELL: Final = np.array([0.25, 0.5, 0.25])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """A capture.

    Attributes:
        path: The file.
        like: What it says of itself, its pixels left out.
        grey: (h, w) float32 light of all colours, small.
        clipped: (h, w) where a sample of it was clipped.
        scale: (2,) px of the capture per sample, along x and y.
    """

    path: Path
    like: Capture
    grey: FloatArray
    clipped: NDArray[np.bool_]
    scale: FloatGrid

    def places(self, places: FloatGrid) -> FloatGrid:
        """Return px of the capture of (..., 2) places on the lattice."""
        return np.asarray((places + 0.5) * self.scale - 0.5)

    def window(self, lens: Lens, box: tuple[int, int, int, int]) -> FloatGrid:
        """Return (h, w, 2) places without distortion, px, of a window (x, y, width, height)."""
        x, y, width, height = box
        columns, rows = np.arange(x, x + width), np.arange(y, y + height)
        x_px, y_px = (
            (line + 0.5) * scale - 0.5
            for line, scale in zip((columns, rows), self.scale, strict=True)
        )
        return lens.lattice(x_px, y_px)


def read_view(path: Path, lens: Lens) -> tuple[View, Capture]:
    """Read a capture and its pixels.

    Raises:
        DecodeError: If it cannot be read, is coded, or is of another size than the geometry.
    """
    capture = read_frame(path, None)
    if capture.samples.dtype == np.uint8 and capture.cfa is None:
        raise DecodeError(
            f"{path.name} is coded in 8 bits; give linear captures: RAW, DNG or 16-bit TIFF"
        )
    if (capture.width, capture.height) != lens.size:
        raise DecodeError(
            f"{path.name} has {capture.width}x{capture.height} px, the geometry is of "
            f"{lens.size[0]}x{lens.size[1]}; give captures of the camera that was calibrated"
        )
    light = capture.linear_rows(0, capture.height)
    clipped = clipped_rows(capture, 0, capture.height)
    if capture.cfa is None:
        light, clipped = light.mean(axis=0), np.asarray(clipped.any(axis=0))
    else:
        light = cv2.sepFilter2D(light, -1, _CELL, _CELL)
    side = min(1.0, WORK_PX / max(light.shape))
    size = (round(light.shape[1] * side), round(light.shape[0] * side))
    small = light if side == 1 else cv2.resize(light, size, interpolation=cv2.INTER_AREA)
    share = cv2.resize(clipped.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    view = View(
        path=path,
        like=without_pixels(capture),
        grey=np.asarray(small, dtype=np.float32),
        clipped=share > 0,
        scale=np.array([light.shape[1] / size[0], light.shape[0] / size[1]]),
    )
    return view, capture


def colours_of(
    capture: Capture, mask: NDArray[np.bool_], illumination: Illumination
) -> tuple[FloatGrid, float]:
    """Return the mean light (3,) of the sensor's colours where `seen`, and the clipped share."""
    light = capture.linear_rows(0, capture.height)
    clipped = clipped_rows(capture, 0, capture.height)
    rows, columns = np.nonzero(mask)
    even = illumination.at(np.stack([columns, rows], axis=-1).astype(np.float64))
    if capture.cfa is None:
        values = light[:, rows, columns] / even
        return values.mean(axis=1), float(clipped[:, rows, columns].mean())
    channel = np.array(cfa_channels(capture.cfa))[rows % 2, columns % 2]
    values = light[rows, columns] / even
    means = np.array([values[channel == c].mean() for c in range(3)], dtype=np.float64)
    return means, float(clipped[rows, columns].mean())
