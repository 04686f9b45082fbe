"""PSFs of a batch of lenses, differentiable, in the colours of a sensor."""

from dataclasses import dataclass

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.psf_model import PsfRegime
from camkit.models_def.optics.psf import spread_tents
from camkit.models_def.optics.search.beam_launch import LEAD
from camkit.models_def.optics.trace import Rays
from camkit.units import UM_PER_MM


@dataclass(frozen=True, slots=True, kw_only=True)
class Pixels:
    """The sensor that a batch is seen by.

    Attributes:
        pitch_um: Of the pixels.
        color_weights: (3, wave), each row sums to 1: how much of each wavelength a colour sees.
        kernel_px: Window of a PSF, odd; light outside counts as lost.
        window_follows: Whether gradients know that the window follows the centroid. Without it a
            gradient counts a shift of the whole PSF, which never comes to pass.
        regime: Whether kernels are splatted rays or sums of waves.
    """

    pitch_um: float
    color_weights: Tensor
    kernel_px: int = 65
    window_follows: bool = False
    regime: PsfRegime = "rays"

    def __post_init__(self) -> None:
        if self.kernel_px < 9 or self.kernel_px % 2 == 0:
            raise ContractError(f"kernel_px must be odd, at least 9; got {self.kernel_px}")
        if not self.pitch_um > 0:
            raise ContractError(f"pitch_um must be > 0; got {self.pitch_um}")


def splat_batch(landings: Rays, pixels: Pixels, *, whole_pupil: bool = False) -> Tensor:
    """Return kernels (start, field, colour, k, k) about the centroid of all colours.

    They sum to the share of the light that falls into the window.

    Args:
        landings: (start, field, wave, LEAD + ray) on the sensor, see `beam`.
        pixels: The sensor.
        whole_pupil: Whether both halves were traced; half of it is mirrored at x = 0.
    """
    size, scale = pixels.kernel_px, UM_PER_MM / pixels.pitch_um
    alive = landings.valid[..., LEAD:].to(landings.x.dtype)
    x, y = landings.x[..., LEAD:] * scale, landings.y[..., LEAD:] * scale
    total = alive.sum((-2, -1), keepdim=True).clamp_min(1)
    middle = (y * alive).sum((-2, -1), keepdim=True) / total
    middle_x = (x * alive).sum((-2, -1), keepdim=True) / total if whole_pupil else 0 * middle
    if not pixels.window_follows:
        middle, middle_x = middle.detach(), middle_x.detach()
    row, column = y - middle + (size - 1) / 2, x - middle_x + (size - 1) / 2
    share = alive / alive.shape[-1]
    if whole_pupil:
        both = spread_tents(row, column, share, size)
    else:
        half = spread_tents(row, column, share / 2, size)
        both = half + half.flip(-1)
    return torch.einsum("cw,sfwyx->sfcyx", pixels.color_weights.to(both.dtype), both)
