"""Malvar-He-Cutler demosaic in torch, as a convolution with four kernels.

Twin of `camkit.runtime.signal.demosaic` (method "fast"); `tests/parity` holds the two together.
"""

import torch
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern, cfa_channels

_CROSS = ((0, 0, -2, 0, 0), (0, 0, 4, 0, 0), (-2, 4, 8, 4, -2), (0, 0, 4, 0, 0), (0, 0, -2, 0, 0))
_ROW = (
    (0, 0, 1, 0, 0),
    (0, -2, 0, -2, 0),
    (-2, 8, 10, 8, -2),
    (0, -2, 0, -2, 0),
    (0, 0, 1, 0, 0),
)
_DIAGONAL = (
    (0, 0, -3, 0, 0),
    (0, 4, 0, 4, 0),
    (-3, 0, 12, 0, -3),
    (0, 4, 0, 4, 0),
    (0, 0, -3, 0, 0),
)


def mosaic(planes: Tensor, cfa: CfaPattern) -> Tensor:
    """Sample the CFA: (b, 3, h, w) -> (b, h, w)."""
    masks = _cell_masks(planes.shape[-2:], cfa, planes)
    return (planes * masks).sum(dim=1)


def developed(raw: FloatArray, gains: tuple[float, float, float], cfa: CfaPattern) -> Tensor:
    """Return white-balanced planes (1, 3, h, w) of (h, w) linear samples."""
    samples = torch.from_numpy(raw)[None]
    factors = torch.tensor(gains).reshape(1, 3, 1, 1).expand(1, 3, *samples.shape[1:])
    return demosaic(samples * mosaic(factors, cfa), cfa)


def demosaic(mosaic: Tensor, cfa: CfaPattern) -> Tensor:
    """Interpolate the missing colours linearly, borders mirrored without repeating the edge.

    Args:
        mosaic: (b, h, w) linear, white balanced; h, w >= 3.
        cfa: Letters in reading order of the cell at pixel (0, 0).

    Returns:
        (b, 3, h, w).

    References: Malvar, He, Cutler 2004, figure 2.
    """
    row = torch.tensor(_ROW, dtype=mosaic.dtype, device=mosaic.device)
    cross = torch.tensor(_CROSS, dtype=mosaic.dtype, device=mosaic.device)
    diagonal = torch.tensor(_DIAGONAL, dtype=mosaic.dtype, device=mosaic.device)
    bank = torch.stack([cross, row, row.T, diagonal])[:, None] / 16
    padded = torch.nn.functional.pad(mosaic[:, None], (2, 2, 2, 2), mode="reflect")
    cross_of, row_of, column_of, diagonal_of = torch.nn.functional.conv2d(padded, bank).unbind(1)
    at = _cell_masks(mosaic.shape[-2:], cfa, mosaic)
    red_rows, blue_rows = _row_mask(at[0]), _row_mask(at[2])
    green_of_red, green_of_blue = at[1] * red_rows, at[1] * blue_rows
    red = at[0] * mosaic + green_of_red * row_of + green_of_blue * column_of + at[2] * diagonal_of
    green = at[1] * mosaic + (at[0] + at[2]) * cross_of
    blue = at[2] * mosaic + green_of_blue * row_of + green_of_red * column_of + at[0] * diagonal_of
    return torch.stack([red, green, blue], dim=1)


def _cell_masks(size: torch.Size, cfa: CfaPattern, like: Tensor) -> Tensor:
    """Return (3, h, w): 1 where a colour is sampled."""
    masks = torch.zeros((3, *size), dtype=like.dtype, device=like.device)
    for row, colours in enumerate(cfa_channels(cfa)):
        for col, colour in enumerate(colours):
            masks[colour, row::2, col::2] = 1
    return masks


def _row_mask(mask: Tensor) -> Tensor:
    """Return (h, 1): 1 in the rows that hold the colour at all."""
    return mask.amax(dim=1, keepdim=True)
