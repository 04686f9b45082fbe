"""The kernels of image points in torch, turned to their azimuth, with gradients to the kernels.

Twin of the lookup of a radial PSF in `camkit.runtime.bank.psf`; `tests/parity` holds the two
together. What needs no gradient asks the runtime.
"""

import torch
from torch import Tensor

PAD_PX = 2


def turned_at(kernels: Tensor, field_heights_mm: Tensor, x_mm: Tensor, y_mm: Tensor) -> Tensor:
    """Return the kernels of image points, turned so that their radial direction points outward.

    Linear in the field height (the last one holds beyond it), a Catmull-Rom gather for the turn,
    zero outside, negatives cut, normalised. On the axis nothing is turned, and neither is the PSF
    of a single field: one PSF for all places has no direction.

    Args:
        kernels: (field, c, h, w) float32, stored for points along +y (down the rows).
        field_heights_mm: (field,) float64, increasing from 0.
        x_mm: (b,).
        y_mm: (b,).

    Returns:
        (b, c, h, w) float32, each kernel sums to 1.

    References: Keys 1981, cubic convolution with a = -1/2.
    """
    x, y = x_mm.to(torch.float64), y_mm.to(torch.float64)
    height = torch.hypot(x, y)
    blended = _blend(kernels, field_heights_mm.to(torch.float64), height)
    has_direction = field_heights_mm.numel() > 1
    on_axis = (height == 0) | (not has_direction)
    safe = torch.where(on_axis, torch.ones_like(height), height)
    out_x = torch.where(on_axis, torch.zeros_like(height), x.abs() / safe)
    out_y = torch.where(on_axis, torch.ones_like(height), y.abs() / safe)
    turned = _turn(blended, out_x, out_y).clamp(min=0)
    # Float64 sums: a sum in another order must not move the result.
    turned = turned / turned.sum(dim=(-2, -1), keepdim=True, dtype=torch.float64)
    if has_direction:
        turned = torch.where((x < 0)[:, None, None, None], turned.flip(-1), turned)
        turned = torch.where((y < 0)[:, None, None, None], turned.flip(-2), turned)
    return turned.to(torch.float32)


def _blend(kernels: Tensor, heights: Tensor, height: Tensor) -> Tensor:
    """Interpolate (field, c, h, w) linearly in height to (b, 3, h, w)."""
    if heights.numel() == 1:
        return kernels.expand(height.numel(), -1, -1, -1)
    low = (torch.searchsorted(heights, height, right=True) - 1).clamp(0, heights.numel() - 2)
    share = ((height - heights[low]) / (heights[low + 1] - heights[low])).clamp(0, 1)
    share = share.to(kernels.dtype)[:, None, None, None]
    return (1 - share) * kernels[low] + share * kernels[low + 1]


def _turn(kernels: Tensor, out_x: Tensor, out_y: Tensor) -> Tensor:
    """Rotate (b, 3, h, w) kernels so that their +y points along (out_x, out_y)."""
    b, c, h, w = kernels.shape
    dy = torch.arange(h, dtype=torch.float64, device=kernels.device)[:, None] - h // 2
    dx = torch.arange(w, dtype=torch.float64, device=kernels.device)[None, :] - w // 2
    out_x, out_y = out_x[:, None, None], out_y[:, None, None]
    rows = dx * out_x + dy * out_y + h // 2
    cols = dx * out_y - dy * out_x + w // 2
    row0, col0 = rows.floor(), cols.floor()
    row_weights = _catmull_rom(rows - row0)
    col_weights = _catmull_rom(cols - col0)
    padded = torch.nn.functional.pad(kernels, (PAD_PX,) * 4).reshape(b, c, -1)
    turned = torch.zeros_like(kernels)
    for i in range(4):
        row = (row0.long() + (i - 1 + PAD_PX)).clamp(0, h + 2 * PAD_PX - 1)
        for j in range(4):
            col = (col0.long() + (j - 1 + PAD_PX)).clamp(0, w + 2 * PAD_PX - 1)
            index = (row * (w + 2 * PAD_PX) + col).reshape(b, 1, -1).expand(-1, c, -1)
            weight = (row_weights[i] * col_weights[j]).to(kernels.dtype)[:, None]
            turned += weight * padded.gather(2, index).reshape(b, c, h, w)
    return turned


def _catmull_rom(t: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return the weights of the samples -1, 0, 1, 2 for a position t in 0..1."""
    t2, t3 = t * t, t * t * t
    return (
        0.5 * (2 * t2 - t3 - t),
        0.5 * (3 * t3 - 5 * t2 + 2),
        0.5 * (4 * t2 - 3 * t3 + t),
        0.5 * (t3 - t2),
    )
