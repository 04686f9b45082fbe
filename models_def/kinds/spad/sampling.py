"""Sampling of light by an array of small pixels: a kernel, and one sub-pixel of every pixel.

    fine picture (4 h, 4 w) -- kernel 11x11 -- sub-pixel `phase` of every 4x4 -- samples (h, w)

low_fill   nothing before the array: the kernel is a point
full_fill  a pixel that sees all of its 4x4 sub-pixels: their mean, and 16 times the light
gaussian   a diffuser
learned    the plate whose kernel was trained

All four are a kernel and a phase, so one sum simulates them. The fine picture goes on at its
border as its outermost sub-pixels do.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import PHASE, SCALE
from camkit.psf import PSF_SUM_TOLERANCE
from camkit.runtime.kinds.spad.finer.linear import Grid
from camkit.runtime.kinds.spad.finer.sampling import (
    GAUSSIAN_PIXELS,
    box_kernel,
    gaussian_kernel,
    point_kernel,
)

Mode = Literal["low_fill", "full_fill", "gaussian", "learned"]

MODES: Final[tuple[str, ...]] = get_args(Mode)
PITCH_UM: Final = 150.0
FINE_PITCH_UM: Final = PITCH_UM / SCALE
PSF_SIDE: Final = 11
HALF: Final = PSF_SIDE // 2
GAUSSIAN_SIGMA: Final = SCALE * GAUSSIAN_PIXELS
"""Sub-pixels."""
FULL_LIGHT: Final = float(SCALE**2)
"""A pixel of 4x4 sub-pixels collects so many times the light of one of a sub-pixel."""


def gaussian_psf(sigma: float = GAUSSIAN_SIGMA) -> FloatArray:
    """Return an (11, 11) Gaussian whose weights sum to 1; sigma in sub-pixels, > 0.

    Raises:
        ContractError: If sigma is not a number > 0.
    """
    return gaussian_kernel(PSF_SIDE, sigma)


def see_through(fine: Tensor, kernel: Tensor, phase: int = PHASE) -> Tensor:
    """Return the light of every pixel, S(p * I) of eq. (4.1).

    Args:
        fine: (b, 1, 4 h, 4 w) light.
        kernel: (n, n), n odd: the light of a point as it falls on the sensor.
        phase: Sub-pixel of its block, along either axis, at which a pixel sees.

    Returns:
        (b, 1, h, w).

    Raises:
        ContractError: If the picture is not of whole pixels.
    """
    if fine.shape[-1] % SCALE or fine.shape[-2] % SCALE:
        raise ContractError(
            f"the fine picture must be of whole {SCALE}x{SCALE} pixels; got {tuple(fine.shape)}"
        )
    half = kernel.shape[-1] // 2
    wide = functional.pad(fine, (half,) * 4, mode="replicate")
    # a convolution, so the correlation of torch gets the kernel turned about
    weights = kernel.flip(0, 1)[None, None]
    return functional.conv2d(wide[..., phase:, phase:], weights, stride=SCALE)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampling:
    """A way of sampling.

    Attributes:
        mode: One of `MODES`.
        kernel: (11, 11) float32, >= 0, of unit sum.
        phase: Sub-pixel of its block, along either axis, at which a pixel sees.
    """

    mode: Mode
    kernel: FloatArray
    phase: int = PHASE

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ContractError(f"sampling must be one of {', '.join(MODES)}; got {self.mode!r}")
        if not 0 <= self.phase < SCALE:
            raise ContractError(f"phase must be one of 0..{SCALE - 1}; got {self.phase}")
        kernel = self.kernel
        if kernel.shape != (PSF_SIDE, PSF_SIDE) or not np.isfinite(kernel).all():
            raise ContractError(
                f"a kernel must be finite ({PSF_SIDE}, {PSF_SIDE}); got {kernel.shape}"
            )
        if (kernel < 0).any() or abs(float(kernel.sum()) - 1) > PSF_SUM_TOLERANCE:
            raise ContractError(
                f"a kernel must be >= 0 and of unit sum; got {kernel.min():g}, {kernel.sum():g}"
            )

    @property
    def light(self) -> float:
        """Return the light of a pixel in units of that of one sub-pixel."""
        return FULL_LIGHT if self.mode == "full_fill" else 1.0

    def see(self, fine: Tensor) -> Tensor:
        """Return (b, 1, h, w) light of the pixels from (b, 1, 4 h, 4 w), white = 1 in both."""
        return see_through(fine, torch.from_numpy(self.kernel).to(fine), self.phase)


_KERNELS: Final[Mapping[str, Callable[[int], FloatArray]]] = {
    "low_fill": lambda _: point_kernel(PSF_SIDE),
    "full_fill": lambda phase: box_kernel(PSF_SIDE, Grid(scale=SCALE, phase=phase)),
    "gaussian": lambda _: gaussian_psf(),
}


def make_sampling(
    mode: str, *, kernel: FloatArray | None = None, sigma: float | None = None, phase: int = PHASE
) -> Sampling:
    """Make a way of sampling.

    Args:
        mode: One of `MODES`.
        kernel: Of the plate; of `learned` alone, which needs it.
        sigma: Of `gaussian` alone, in sub-pixels; None for that of the thesis.
        phase: See `Sampling`.

    Raises:
        ContractError: If these do not go together.
    """
    if (kernel is not None) != (mode == "learned"):
        raise ContractError(
            f"a kernel belongs to the sampling learned, and to it alone; got {mode}"
        )
    if sigma is not None and mode != "gaussian":
        raise ContractError(f"sigma belongs to the sampling gaussian; got {mode}")
    if kernel is None:
        if mode not in _KERNELS:
            raise ContractError(f"sampling must be one of {', '.join(MODES)}; got {mode!r}")
        kernel = _KERNELS[mode](phase) if sigma is None else gaussian_psf(sigma)
    valid_mode: Mode = mode  # type: ignore[assignment]
    return Sampling(mode=valid_mode, kernel=kernel, phase=phase)
