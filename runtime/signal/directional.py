"""Demosaicking along edges: the "quality" method of `camkit.runtime.signal.demosaic`.

    green along rows and along columns at every pixel that has none
      -> weight of the row direction: how much less the colour difference changes along it
      -> green -> red and blue at green pixels -> blue at red and red at blue
      -> refinement: colour differences smoothed along the weighted directions (a posteriori)

The order and the refinement are Menon's; the two directions are not chosen but weighted by the
inverse square of the change, which leaves smooth regions free of false decisions. A scaled mosaic
gives the scaled picture; nothing is clipped, negatives are kept.

References: Menon, Andriani, Calvagno, "Demosaicing with directional filtering and a posteriori
decision", IEEE Transactions on Image Processing 16(1), 2007. Pekkucuksen, Altunbasak, "Gradient
based threshold free color filter array interpolation", ICIP 2010 (the weights).
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.contracts import CfaPattern, FloatArray, cfa_channels

# reach: green 2, its change 1, weights 2, red and blue 1 + 1, refinement 1 + 1 + 1
DIRECTIONAL_MARGIN_PX: Final = 12

Mask = NDArray[np.bool_]

_INTERPOLATE: Final = np.array([[-0.25, 0.5, 0.5, 0.5, -0.25]], dtype=np.float32)
_CHANGE: Final = np.array([[-1.0, 0.0, 1.0]], dtype=np.float32)
_MEAN2: Final = np.array([[0.5, 0.0, 0.5]], dtype=np.float32)
_MEAN3: Final = np.full((1, 3), 1 / 3, dtype=np.float32)
_SUPPORT: Final = np.ones((5, 5), dtype=np.float32)


def demosaic_directional(mosaic: FloatArray, cfa: CfaPattern) -> FloatArray:
    """Interpolate a (h, w) float32 mosaic to (3, h, w) along edges."""
    colors = np.array(cfa_channels(cfa), dtype=np.uint8)
    height, width = mosaic.shape
    own = np.tile(colors, ((height + 1) // 2, (width + 1) // 2))[:height, :width]
    green, row_weight = _green(mosaic, own == 1)
    # the rows whose other colour is red; the others hold blue
    red_row = np.resize((colors == 0).any(axis=1), height)[:, None]
    planes = np.stack([np.where(own == 0, mosaic, 0), green, np.where(own == 2, mosaic, 0)])
    _fill_at_green(planes, own, red_row)
    _fill_at_opposite(planes, own, row_weight, _MEAN2)
    _refine_green(planes, own, row_weight)
    _fill_at_green(planes, own, red_row)
    _fill_at_opposite(planes, own, row_weight, _MEAN3)
    return planes


def _filter(plane: FloatArray, kernel: FloatArray) -> FloatArray:
    out = cv2.filter2D(plane, cv2.CV_32F, kernel, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(out, dtype=np.float32)


def _column(kernel: FloatArray) -> FloatArray:
    return np.ascontiguousarray(kernel.T)


def _along(plane: FloatArray, kernel: FloatArray, row_weight: FloatArray) -> FloatArray:
    """Filter along rows and columns and mix by the weight of the rows."""
    by_column = _filter(plane, _column(kernel))
    mixed = _filter(plane, kernel)
    mixed -= by_column
    mixed *= row_weight
    mixed += by_column
    return mixed


def _green(mosaic: FloatArray, at_green: Mask) -> tuple[FloatArray, FloatArray]:
    """Give green everywhere and the weight 0..1 of the row direction."""
    along_row = _filter(mosaic, _INTERPOLATE)
    along_column = _filter(mosaic, _column(_INTERPOLATE))
    # Pekkucuksen 2010, eq. (4) to (6): green minus the other colour, whichever is interpolated
    sign = np.where(at_green, np.float32(1), np.float32(-1))
    change_row = np.abs(_filter(sign * (mosaic - along_row), _CHANGE))
    change_column = np.abs(_filter(sign * (mosaic - along_column), _column(_CHANGE)))
    against_row = np.square(_filter(change_row, _SUPPORT))
    row_weight = np.square(_filter(change_column, _SUPPORT))
    total = against_row + row_weight
    np.divide(row_weight, total, out=row_weight, where=total > 0)
    row_weight[total == 0] = 0.5
    mixed = along_column + row_weight * (along_row - along_column)
    return np.where(at_green, mosaic, mixed), row_weight


def _fill_at_green(planes: FloatArray, own: NDArray[np.uint8], red_row: Mask) -> None:
    """Fill red and blue at green pixels: mean colour difference of the two neighbours."""
    at_green = own == 1
    for color in (0, 2):
        difference = np.where(own == color, planes[color] - planes[1], np.float32(0))
        in_row = red_row if color == 0 else ~red_row
        found = np.where(in_row, _filter(difference, _MEAN2), _filter(difference, _column(_MEAN2)))
        np.copyto(planes[color], planes[1] + found, where=at_green)


def _fill_at_opposite(
    planes: FloatArray, own: NDArray[np.uint8], row_weight: FloatArray, kernel: FloatArray
) -> None:
    """Fill red at blue and blue at red: the difference of the two, filtered along edges."""
    found = _along(planes[0] - planes[2], kernel, row_weight)
    np.copyto(planes[0], planes[2] + found, where=own == 2)
    np.copyto(planes[2], planes[0] - found, where=own == 0)


def _refine_green(planes: FloatArray, own: NDArray[np.uint8], row_weight: FloatArray) -> None:
    """Take green at red and blue from the difference smoothed along edges (Menon, section IV)."""
    for color in (0, 2):
        smooth = _along(planes[color] - planes[1], _MEAN3, row_weight)
        np.copyto(planes[1], planes[color] - smooth, where=own == color)
