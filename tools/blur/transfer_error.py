"""A measured PSF beside the one that captures were simulated with."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from camkit.arrays import FloatArray
from camkit.psf import FrozenPsf
from camkit.runtime.bank.psf import FieldKernels

MOST_FREQUENCY: Final = 0.3
"""Cycles per pixel up to which transfers are compared."""
_STEP: Final = 0.025
_SHIFTS_PX: Final = np.arange(-14, 14.01, 0.1)
_MARGIN_PX: Final = 14


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransferError:
    """The error of kernels at one height.

    Attributes:
        height_mm: Distance from the axis.
        moved_px: By which all colours together lie farther out: photographs do not show it.
        errors: (c,) root mean square of the difference of transfers, phase included.
        size: (c,) root mean square of the transfer itself.
    """

    height_mm: float
    moved_px: float
    errors: FloatArray
    size: FloatArray


def compare_transfers(measured: FrozenPsf, truth: FieldKernels, height_mm: float) -> TransferError:
    """Return the error of a measured PSF at a height.

    Args:
        measured: Of three colours, blue first.
        truth: Kernels (red, green, blue) of the camera.
        height_mm: Distance from the axis.
    """
    frequencies = np.arange(-MOST_FREQUENCY, MOST_FREQUENCY + 1e-9, _STEP)
    inside = np.hypot(frequencies[:, None], frequencies) <= MOST_FREQUENCY + 1e-9
    true, measured_transfer = (
        _transfer(kernels, frequencies)
        for kernels in (truth.at(0.0, height_mm), kernels_at(measured, height_mm))
    )
    best = None
    for shift in _SHIFTS_PX:
        difference = measured_transfer * np.exp(-2j * np.pi * frequencies * shift)[:, None] - true
        errors = np.sqrt((np.abs(difference[:, inside]) ** 2).mean(axis=1))
        if best is None or errors[1] < best[1][1]:
            best = float(shift), errors
    assert best is not None
    size = np.sqrt((np.abs(true[:, inside]) ** 2).mean(axis=1))
    return TransferError(height_mm=height_mm, moved_px=best[0], errors=best[1], size=size)


def kernels_at(psf: FrozenPsf, height_mm: float) -> FloatArray:
    """Return (c, h, w): kernels of a radial PSF below the axis, red first."""
    heights = psf.field_heights_mm
    shares = [np.interp(height_mm, heights, unit) for unit in np.eye(heights.size)]
    return np.asarray(np.tensordot(shares, psf.kernels[:, 0, ::-1], axes=1))


def with_true_places(measured: FrozenPsf, truth: FieldKernels) -> FrozenPsf:
    """Return a measured PSF whose kernels lie as far out as the true ones.

    How far all colours together lie from where a point is expected is distortion, which no
    photograph of an unknown scene shows; a comparison pixel by pixel needs it.
    """
    pad = ((0, 0), (0, 0), (0, 0), (_MARGIN_PX, _MARGIN_PX), (_MARGIN_PX, _MARGIN_PX))
    kernels = np.pad(measured.kernels.astype(np.float64), pad)
    for n, height_mm in enumerate(measured.field_heights_mm):
        moved_px = compare_transfers(measured, truth, float(height_mm)).moved_px
        kernels[n] = ndimage.shift(kernels[n], (0, 0, moved_px, 0), order=1)
    kernels /= kernels.sum(axis=(-2, -1), keepdims=True)
    return replace(measured, kernels=kernels.astype(np.float32))


def _transfer(kernels: FloatArray, frequencies: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return (c, fy, fx)."""
    waves = [
        np.exp(-2j * np.pi * frequencies[:, None] * (np.arange(side) - side // 2))
        for side in kernels.shape[-2:]
    ]
    return np.asarray(np.einsum("fy,cyx,gx->cfg", waves[0], kernels.astype(np.float64), waves[1]))
