"""Spots and kernels of copies."""

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.psf import spread_tents
from camkit.models_def.optics.tolerance.fabricated import Landing
from camkit.units import UM_PER_MM


def spot_rms_mm(landing: Landing) -> Tensor:
    """Return RMS radii (copy, field) about the centroid of all wavelengths, which count alike."""
    weight = landing.weight / landing.weight.sum(-1, keepdim=True).clamp_min(1e-300)
    share = weight / weight.sum((-2, -1), keepdim=True)
    square = torch.zeros_like(share)
    for place in (landing.rays.x, landing.rays.y):
        square = square + (place - (share * place).sum((-2, -1), keepdim=True)) ** 2
    return torch.sqrt((share * square).sum((-2, -1)))


def copy_kernels(
    landing: Landing, color_weights: Tensor, size_px: int, pitch_um: float
) -> tuple[Tensor, Tensor]:
    """Return kernels (copy, field, 3, k, k) that sum to 1, and the light kept (copy, field).

    As they fall on the sensor for a point at +y, the centre pixel on the copy's own chief ray of
    the reference wavelength (decision 0001).

    Args:
        landing: See `fabricated.land`.
        color_weights: (3, wave), each row sums to 1.
        size_px: Odd kernel side.
        pitch_um: Of the pixels.

    Raises:
        ContractError: If the side is even, or a kernel gets no light.
    """
    if size_px < 1 or size_px % 2 == 0:
        raise ContractError(f"kernel side must be odd; got {size_px}")
    scale, centre = UM_PER_MM / pitch_um, (size_px - 1) / 2
    column = (landing.rays.x - landing.chief_x_mm[..., None, None]) * scale + centre
    row = (landing.rays.y - landing.chief_y_mm[..., None, None]) * scale + centre
    share = landing.weight / landing.weight.sum(-1, keepdim=True).clamp_min(1e-300)
    flat = spread_tents(row, column, share, size_px).flatten(-2)
    colored = torch.einsum("cw,sfwp->sfcp", color_weights.to(flat.dtype), flat)
    light = colored.sum(-1, keepdim=True)
    if bool((light <= 0).any()):
        raise ContractError("no light reaches a kernel; check errors, focus and pixel pitch")
    kernels = (colored / light).reshape(*colored.shape[:3], size_px, size_px)
    return kernels, light[..., 0].amin(-1)


def window_px(kernels: Tensor, loss: float) -> int:
    """Return the least odd side about the centre outside which no kernel has more than `loss`.

    Args:
        kernels: (..., k, k).
        loss: Share of the light.
    """
    side = kernels.shape[-1]
    middle = side // 2
    place = torch.arange(side) - middle
    ring = torch.maximum(place[:, None].abs(), place[None].abs()).flatten()
    flat = kernels.reshape(-1, side * side)
    by_ring = torch.zeros(len(flat), middle + 1, dtype=flat.dtype)
    inside = by_ring.index_add(1, ring, flat).cumsum(1).amin(0)
    enough = inside >= inside[-1] - loss
    return 2 * int(enough.to(torch.int8).argmax()) + 1
