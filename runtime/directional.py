"""Demosaicking along edges: the "quality" method of `camkit.runtime.demosaic`.

    green along rows and along columns at every red and blue pixel
      -> the direction in which the colour difference changes less, over a 5x5 neighbourhood
      -> green -> red and blue at green pixels -> blue at red and red at blue along the direction
      -> refinement: colour differences smoothed along the direction (a posteriori)

Linear in exposure (a scaled mosaic gives the scaled picture), no clipping, negatives kept.

References: Menon, Andriani, Calvagno, "Demosaicing with directional filtering and a posteriori
decision", IEEE Transactions on Image Processing 16(1), 2007.
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.contracts import CfaPattern, FloatArray, cfa_channels

# reach: green 2, its change 2, decision 2, red and blue 1 + 1, refinement 1 + 1 + 1
DIRECTIONAL_MARGIN_PX: Final = 12

Mask = NDArray[np.bool_]

_GREEN: Final = np.array([[-0.25, 0.5, 0.5, 0.5, -0.25]], dtype=np.float32)  # section II
_MEAN2: Final = np.array([[0.5, 0.0, 0.5]], dtype=np.float32)
_MEAN3: Final = np.full((1, 3), 1 / 3, dtype=np.float32)
_STEP: Final = np.array([[0.0, 0.0, 1.0, 0.0, -1.0]], dtype=np.float32)
_DECISION: Final = np.array(  # section III, figure 4: support of the classifier
    [[0, 0, 1, 0, 1], [0, 0, 0, 1, 0], [0, 0, 3, 0, 3], [0, 0, 0, 1, 0], [0, 0, 1, 0, 1]],
    dtype=np.float32,
)


def demosaic_directional(mosaic: FloatArray, cfa: CfaPattern) -> FloatArray:
    """Interpolate a (h, w) float32 mosaic to (3, h, w) along edges."""
    colors = np.array(cfa_channels(cfa))
    height, width = mosaic.shape
    own = np.tile(colors, ((height + 1) // 2, (width + 1) // 2))[:height, :width]
    green, along_row = _green(mosaic, own)
    # the rows whose other colour is red; the others hold blue
    red_row = np.resize((colors == 0).any(axis=1), height)[:, None]
    planes = np.stack([np.where(own == 0, mosaic, 0), green, np.where(own == 2, mosaic, 0)])
    _fill_at_green(planes, own, red_row)
    _fill_at_opposite(planes, own, along_row)
    _refine(planes, own, red_row, along_row)
    return planes


def _filter(plane: FloatArray, kernel: FloatArray) -> FloatArray:
    out = cv2.filter2D(plane, cv2.CV_32F, kernel, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(out, dtype=np.float32)


def _along(plane: FloatArray, kernel: FloatArray, along_row: Mask) -> FloatArray:
    """Filter along the row where the mask says so, else along the column."""
    return np.where(along_row, _filter(plane, kernel), _filter(plane, kernel.T.copy()))


def _green(mosaic: FloatArray, own: NDArray[np.int64]) -> tuple[FloatArray, Mask]:
    """Give green everywhere and, per pixel, whether rows are the better direction."""
    at_green = own == 1
    by_row = np.where(at_green, mosaic, _filter(mosaic, _GREEN))
    by_column = np.where(at_green, mosaic, _filter(mosaic, _GREEN.T.copy()))
    difference_row = mosaic - by_row
    difference_column = mosaic - by_column
    change_row = np.abs(_filter(difference_row, _STEP))
    change_column = np.abs(_filter(difference_column, _STEP.T.copy()))
    along_row = _filter(change_column, _DECISION.T.copy()) >= _filter(change_row, _DECISION)
    return np.where(along_row, by_row, by_column), along_row


def _fill_at_green(planes: FloatArray, own: NDArray[np.int64], red_row: Mask) -> None:
    """Fill red and blue at green pixels: mean colour difference of the two neighbours."""
    at_green = own == 1
    for color in (0, 2):
        difference = np.where(own == color, planes[color] - planes[1], 0)
        in_row = red_row == (color == 0)
        found = _along(difference, _MEAN2, in_row)
        planes[color] = np.where(at_green, planes[1] + found, planes[color])


def _fill_at_opposite(planes: FloatArray, own: NDArray[np.int64], along_row: Mask) -> None:
    """Fill red at blue and blue at red from the two neighbours along the direction."""
    difference = planes[0] - planes[2]
    found = _along(difference, _MEAN2, along_row)
    red, blue = planes[0].copy(), planes[2].copy()
    planes[0] = np.where(own == 2, blue + found, red)
    planes[2] = np.where(own == 0, red - found, blue)


def _refine(planes: FloatArray, own: NDArray[np.int64], red_row: Mask, along_row: Mask) -> None:
    """Replace the differences of neighbouring colours by their mean along the direction."""
    smooth_red = _along(planes[0] - planes[1], _MEAN3, along_row)
    smooth_blue = _along(planes[2] - planes[1], _MEAN3, along_row)
    planes[1] = np.where(own == 0, planes[0] - smooth_red, planes[1])
    planes[1] = np.where(own == 2, planes[2] - smooth_blue, planes[1])
    _fill_at_green(planes, own, red_row)
    difference = planes[0] - planes[2]
    smooth = _along(difference, _MEAN3, along_row)
    red, blue = planes[0].copy(), planes[2].copy()
    planes[0] = np.where(own == 2, blue + smooth, red)
    planes[2] = np.where(own == 0, red - smooth, blue)
