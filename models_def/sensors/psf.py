"""The PSF of an image point, in torch: wavelengths weighted, fields blended, turned if radial.

    FrozenPsf (field, depth, wavelength) -> color_kernels -> FieldKernels (field, c) -> at(x, y)

Twin of `camkit.runtime.bank.psf`; `tests/parity` holds the two together.
"""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.contracts import FrozenPsf, Symmetry, depth_weights, focus_weights
from camkit.errors import ContractError

PAD_PX = 2


def wavelength_weights(
    psf_wavelengths_um: NDArray[np.float64],
    wavelengths_um: NDArray[np.float64],
    response: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Integrate the response of the channels against the PSF's wavelength samples.

    The PSF is taken as linear between its wavelengths and constant beyond them, the response as
    linear between its own and zero beyond them; the integral of their product is then exact.

    Args:
        psf_wavelengths_um: (wavelength,), increasing.
        wavelengths_um: (n,), increasing.
        response: (c, n) >= 0.

    Returns:
        (c, wavelength) weights; each row sums to 1.

    Raises:
        ContractError: If shapes disagree or a channel has no response.
    """
    if response.ndim != 2 or response.shape[1] != wavelengths_um.size:
        raise ContractError(f"response must be (c, {wavelengths_um.size}); got {response.shape}")
    unit = np.eye(psf_wavelengths_um.size)

    def product(at_um: NDArray[np.float64]) -> NDArray[np.float64]:
        sensed = np.stack([np.interp(at_um, wavelengths_um, row) for row in response])
        hats = np.stack([np.interp(at_um, psf_wavelengths_um, row) for row in unit])
        return sensed[:, None, :] * hats[None, :, :]

    if wavelengths_um.size == 1:
        weights = product(wavelengths_um)[..., 0]
    else:
        knots = np.union1d(psf_wavelengths_um, wavelengths_um)
        knots = knots[(knots >= wavelengths_um[0]) & (knots <= wavelengths_um[-1])]
        low, high = knots[:-1], knots[1:]
        simpson = product(low) + 4 * product((low + high) / 2) + product(high)
        weights = (simpson * ((high - low) / 6)).sum(axis=-1)
    sums = weights.sum(axis=1, keepdims=True)
    if not (sums > 0).all():
        raise ContractError(f"every channel needs a response > 0; sums are {sums.ravel()}")
    return np.asarray(weights / sums, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldKernels:
    """Kernels of the channels at the fields of a PSF; see `camkit.contracts.FrozenPsf`.

    Attributes:
        kernels: (field, c, h, w) float32, odd sides, each sums to 1.
        field_heights_mm: (field,) float64.
        symmetry: How the kernels of other image points follow.
        grid_x_mm: (column,) float64 of a grid.
        grid_y_mm: (row,) float64 of a grid.
    """

    kernels: Tensor
    field_heights_mm: Tensor
    symmetry: Symmetry = "radial"
    grid_x_mm: Tensor | None = None
    grid_y_mm: Tensor | None = None

    def at(self, x_mm: Tensor, y_mm: Tensor) -> Tensor:
        """Return the kernels of image points.

        Args:
            x_mm: (b,) positions from the axis, to the right.
            y_mm: (b,) positions from the axis, down the rows.

        Returns:
            (b, c, h, w) float32, each kernel sums to 1.
        """
        if self.grid_x_mm is not None and self.grid_y_mm is not None:
            field, share = grid_neighbours((self.grid_x_mm, self.grid_y_mm), x_mm, y_mm)
            shares = share.to(self.kernels.dtype)[..., None, None, None]
            return (shares * self.kernels[field]).sum(1)
        if self.symmetry == "uniform":
            return self.kernels.expand(x_mm.numel(), -1, -1, -1)
        return _turned_at(self.kernels, self.field_heights_mm, x_mm, y_mm)


def color_kernels(
    psf: FrozenPsf,
    wavelengths_um: NDArray[np.float64],
    response: NDArray[np.float64],
    *,
    depth_mm: float | None = None,
    focus_um: float = 0.0,
) -> FieldKernels:
    """Weight the wavelength kernels into one kernel per field and channel.

    A lens of revolution is symmetric about the meridional plane, so the kernels of a radial PSF
    are made symmetric about their middle column, which also takes half of the noise of the
    tracing. Others are left as they are.

    Args:
        psf: The frozen PSF.
        wavelengths_um: (n,) grid of the response.
        response: (c, n) response of the channels.
        depth_mm: Object distance, see `depth_weights`; None for the mean kernel over the depths.
        focus_um: How far the sensor lies from its nominal place, see `focus_weights`.

    Raises:
        ContractError: If the PSF does not reach depth or focus, or the response does not fit.
    """
    weights = torch.from_numpy(wavelength_weights(psf.wavelengths_um, wavelengths_um, response))
    shares = torch.from_numpy(depth_weights(psf.depths_mm, depth_mm))
    in_focus = torch.from_numpy(focus_weights(psf.focus_um, focus_um))
    every = psf.kernels[None]
    if psf.focus_kernels is not None:
        every = np.concatenate([every, psf.focus_kernels])
    kernels = torch.einsum("s,sfdlhw->fdlhw", in_focus, torch.from_numpy(every.astype(np.float64)))
    mixed = torch.einsum("cl,flhw->fchw", weights, torch.einsum("d,fdlhw->flhw", shares, kernels))
    if psf.symmetry == "radial":
        mixed = 0.5 * (mixed + mixed.flip(-1))
    return field_kernels((mixed / mixed.sum(dim=(-2, -1), keepdim=True)).to(torch.float32), psf)


def field_kernels(kernels: Tensor, psf: FrozenPsf) -> FieldKernels:
    """Return (field, c, h, w) kernels at the fields of a PSF."""
    grid = (psf.grid_x_mm, psf.grid_y_mm)
    x_mm, y_mm = (None if axis is None else torch.from_numpy(axis.copy()) for axis in grid)
    return FieldKernels(
        kernels=kernels,
        field_heights_mm=torch.from_numpy(psf.field_heights_mm.copy()),
        symmetry=psf.symmetry,
        grid_x_mm=x_mm,
        grid_y_mm=y_mm,
    )


def grid_neighbours(
    grid_mm: tuple[Tensor, Tensor], x_mm: Tensor, y_mm: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the four fields (b, 4) of a grid around image points, and their shares (b, 4).

    Bilinear; a point beyond the rim is taken on it.

    Args:
        grid_mm: (column,) and (row,) positions, increasing; fields lie row by row.
        x_mm: (b,).
        y_mm: (b,).
    """
    columns, rows = (
        _axis_neighbours(axis.to(torch.float64), at.to(torch.float64).contiguous())
        for axis, at in zip(grid_mm, (x_mm, y_mm), strict=True)
    )
    field = rows[0][:, :, None] * grid_mm[0].numel() + columns[0][:, None, :]
    share = rows[1][:, :, None] * columns[1][:, None, :]
    return field.flatten(1), share.flatten(1)


def _axis_neighbours(axis: Tensor, at: Tensor) -> tuple[Tensor, Tensor]:
    """Return the (b, 2) neighbours on one axis and their shares."""
    low = (torch.searchsorted(axis, at, right=True) - 1).clamp(0, max(axis.numel() - 2, 0))
    high = (low + 1).clamp(max=axis.numel() - 1)
    step = torch.where(high > low, axis[high] - axis[low], 1.0)
    share = ((at - axis[low]) / step).clamp(0, 1)
    share = torch.where(high > low, share, 0.0)
    return torch.stack([low, high], 1), torch.stack([1 - share, share], 1)


def _turned_at(kernels: Tensor, field_heights_mm: Tensor, x_mm: Tensor, y_mm: Tensor) -> Tensor:
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
