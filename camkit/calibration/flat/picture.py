"""A picture as the mean light of green in blocks; noise, dust and single lights are averaged."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.cfa import cfa_channels
from camkit.errors import DecodeError
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.merging.merge import clipped_rows
from camkit.runtime.merging.survey import read_frame, without_pixels

FloatGrid = NDArray[np.float64]

BLOCKS: Final = 64
"""Along the longer side."""
LEAST_BLOCKS: Final = 8
"""Along the shorter side."""
LEAST_SIDE: Final = 4
"""Samples along a side of a block."""
MOST_CLIPPED: Final = 1e-3
LEAST_LIGHT: Final = 0.002
_SPREADS: Final = 5.0
_MAD_TO_SIGMA: Final = 1.4826
_GREEN: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class FlatPicture:
    """The light of a picture.

    Attributes:
        path: The file.
        like: What it says of itself, its pixels left out.
        light: (row, column) mean of each block, 1 at white.
        x_px: (column,) middles of the blocks, from the left pixel's centre.
        y_px: (row,) likewise, from the top.
    """

    path: Path
    like: Capture
    light: FloatGrid
    x_px: FloatGrid
    y_px: FloatGrid


def read_flat(path: Path, mosaic: MosaicOptions | None) -> FlatPicture:
    """Read a picture of an even or uneven display.

    Raises:
        DecodeError: If it cannot be read, is coded, clipped or black.
    """
    capture = read_frame(path, mosaic)
    if capture.samples.dtype == np.uint8 and capture.cfa is None:
        raise DecodeError(
            f"{path.name} is coded in 8 bits; give linear pictures: RAW, EXR, 16-bit TIFF or PNG"
        )
    green, clipped, cell = green_of(capture)
    share = float(np.mean(clipped))
    if share > MOST_CLIPPED:
        raise DecodeError(f"{path.name}: {share:.1%} of green is clipped; expose less")
    side = max(LEAST_SIDE, max(green.shape) // BLOCKS)
    if min(green.shape) // side < LEAST_BLOCKS:
        raise DecodeError(
            f"{path.name} has {capture.width}x{capture.height} pixels; a flat needs "
            f"{LEAST_BLOCKS} blocks of {side * cell} pixels along the shorter side"
        )
    light = _block_means(green, side)
    if float(light.min()) < LEAST_LIGHT:
        raise DecodeError(
            f"{path.name} is black in places: less than {LEAST_LIGHT:.1%} of white; expose longer, "
            "and fill the picture"
        )
    y_px, x_px = (
        (np.arange(count) * side + (side - 1) / 2) * cell + (cell - 1) / 2 for count in light.shape
    )
    like = without_pixels(capture)
    return FlatPicture(path=path, like=like, light=light, x_px=x_px, y_px=y_px)


def green_of(capture: Capture) -> tuple[FloatGrid, NDArray[np.bool_], int]:
    """Return light of green, where it is clipped, and pixels along a side of its samples.

    Both greens of a cell of a mosaic are one sample, which lies in its middle.
    """
    light = capture.linear_rows(0, capture.height)
    clipped = clipped_rows(capture, 0, capture.height)
    if capture.cfa is None:
        at = _GREEN if capture.channels > _GREEN else 0
        return light[at].astype(np.float64), clipped[at], 1
    high, wide = (n // 2 * 2 for n in light.shape)
    greens = np.argwhere(np.array(cfa_channels(capture.cfa)) == _GREEN)
    sites = [np.s_[dy:high:2, dx:wide:2] for dy, dx in greens.tolist()]
    mean = sum(light[site].astype(np.float64) for site in sites) / len(sites)
    return np.asarray(mean), np.logical_or.reduce([clipped[site] for site in sites]), 2


def check_one_camera(one: Capture, one_path: Path, other: Capture, path: Path) -> None:
    """Refuse a picture that another camera took; exposure and levels may differ.

    Raises:
        DecodeError: If it differs in size or mosaic.
    """
    if (one.width, one.height, one.cfa) != (other.width, other.height, other.cfa):
        raise DecodeError(
            f"pictures differ: {one_path.name} is {_kind(one)}, {path.name} {_kind(other)}; give "
            "pictures of one camera"
        )


def _kind(like: Capture) -> str:
    return f"{like.width}x{like.height} {like.cfa or 'planes'}"


def _block_means(plane: FloatGrid, side: int) -> FloatGrid:
    rows, columns = (n // side for n in plane.shape)
    tiled = plane[: rows * side, : columns * side].reshape(rows, side, columns, side)
    values = tiled.swapaxes(1, 2).reshape(rows, columns, side * side)
    middle = np.median(values, axis=-1, keepdims=True)
    spread = _MAD_TO_SIGMA * np.median(np.abs(values - middle), axis=-1, keepdims=True)
    inliers = np.abs(values - middle) <= np.maximum(_SPREADS * spread, 1e-12)
    return np.asarray(np.where(inliers, values, 0).sum(axis=-1) / inliers.sum(axis=-1))
