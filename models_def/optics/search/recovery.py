"""The merit of a lens behind which a Wiener filter stands: what the filter cannot bring back.

For a scene whose power falls as natural pictures do, and white noise, the mean square error of the
Wiener filter is known in closed form for any transfer function H:

    e = mean over frequencies of S N / (|H|^2 S + N)

so that a lens can be optimised for the recovered picture without a picture, a draw or a network.
The residual of a field and a colour is sqrt(log(e / e of a perfect lens)): the sum of squares is
the mean loss in nepers of power, 4.34 dB each.

References: Sun 2021, eq. (2.9) (filter); van der Schaaf and van Hateren 1996 (spectrum).
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.search.beam import LEAD
from camkit.models_def.optics.trace import Rays
from camkit.units import UM_PER_MM

DB_PER_RESIDUAL_SQUARE = 10 / math.log(10)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryMerit:
    """What stands behind the lens.

    Attributes:
        pitch_um: Of the pixels.
        kernel_px: Window of a PSF, odd; light outside counts as lost.
        color_weights: (3, wave), each row sums to 1: how much of each wavelength a colour sees.
        signal_to_noise: Power of the signal at one cycle per pixel over that of the noise.
        exponent: Of the fall of the signal's power with frequency.
    """

    pitch_um: float
    color_weights: Tensor
    kernel_px: int = 65
    signal_to_noise: float = 0.3
    exponent: float = 2.5

    def __post_init__(self) -> None:
        if self.kernel_px < 9 or self.kernel_px % 2 == 0:
            raise ContractError(f"kernel_px must be odd, at least 9; got {self.kernel_px}")
        if not (self.pitch_um > 0 and self.signal_to_noise > 0):
            raise ContractError("pitch_um and signal_to_noise must be > 0")


def recovery_residuals(landed: Rays, merit: RecoveryMerit) -> Tensor:
    """Give residuals (start, field * colour).

    Args:
        landed: (start, field, wave, LEAD + ray) on the sensor, see `beam`; half the pupil,
            x >= 0.
        merit: What stands behind the lens.
    """
    kernels = splat_batch(landed, merit)
    loss = expected_loss(kernels, merit)
    return torch.sqrt(loss.clamp_min(1e-9)).flatten(1) / math.sqrt(loss[0].numel())


def expected_loss(kernels: Tensor, merit: RecoveryMerit) -> Tensor:
    """Give log(e / e of a perfect lens) (start, field, colour) of kernels (..., k, k)."""
    size = 2 * (merit.kernel_px - 1)
    fy = torch.fft.fftfreq(size, dtype=torch.float64)[:, None]
    fx = torch.fft.rfftfreq(size, dtype=torch.float64)[None]
    ratio = merit.signal_to_noise * (fy**2 + fx**2 + 1 / size**2) ** (-merit.exponent / 2)
    # a half spectrum: columns between the first and the last stand for two
    twice = torch.full_like(fx, 2.0)
    twice[:, 0] = twice[:, -1] = 1.0
    power = torch.fft.rfft2(kernels, s=(size, size)).abs().square()
    error = (twice * ratio / (power * ratio + 1)).sum((-2, -1))
    best = (twice * ratio / (ratio + 1)).sum()
    return torch.log(error / best)


def splat_batch(landed: Rays, merit: RecoveryMerit) -> Tensor:
    """Give kernels (start, field, colour, k, k) about the centroid of all colours.

    They sum to the share of the light that falls into the window.
    """
    size, scale = merit.kernel_px, UM_PER_MM / merit.pitch_um
    alive = landed.valid[..., LEAD:].to(landed.x.dtype)
    x, y = landed.x[..., LEAD:] * scale, landed.y[..., LEAD:] * scale
    total = alive.sum((-2, -1), keepdim=True).clamp_min(1)
    # where the window lies is not a matter of the lens: no gradient through it
    middle = ((y * alive).sum((-2, -1), keepdim=True) / total).detach()
    row, column = y - middle + (size - 1) / 2, x + (size - 1) / 2
    flat = torch.zeros(*row.shape[:3], size * size, dtype=row.dtype)
    share = alive / alive.shape[-1] / 2
    for corner in range(4):
        down, right = divmod(corner, 2)
        place, weight = tent(row, column, (down, right), size)
        flat = flat.scatter_add(-1, place, weight * share)
    half = flat.reshape(*row.shape[:3], size, size)
    both = half + half.flip(-1)
    return torch.einsum("cw,sfwyx->sfcyx", merit.color_weights.to(both.dtype), both)


def tent(
    row: Tensor, column: Tensor, offset: tuple[int, int], size_px: int
) -> tuple[Tensor, Tensor]:
    """Give flat places and weights of one of the four pixels around each ray."""
    top, left = torch.floor(row.detach()), torch.floor(column.detach())
    below, beside = row - top, column - left
    weight = (below if offset[0] else 1 - below) * (beside if offset[1] else 1 - beside)
    y, x = top + offset[0], left + offset[1]
    inside = (y >= 0) & (y < size_px) & (x >= 0) & (x < size_px)
    place = torch.where(inside, y * size_px + x, 0.0).to(torch.int64)
    return place, torch.where(inside, weight, 0.0)
