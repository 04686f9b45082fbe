"""Kernels at another pitch: light spread by the area that samples share."""

from dataclasses import replace
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.calibration.psf_import.kernel_stack import FloatGrid
from camkit.psf import FrozenPsf

SAME_PITCH: Final = 1e-6


def resampled_kernels(kernels: FloatGrid, ratio: float) -> FloatGrid:
    """Return (..., h, w) kernels at another pitch; light stays.

    Args:
        kernels: Odd sides; the middle sample stays in the middle.
        ratio: Pitch of the kernels over the pitch wanted.
    """
    if abs(ratio - 1) < SAME_PITCH:
        return kernels
    rows, columns = (_shares(side, ratio) for side in kernels.shape[-2:])
    return np.asarray(rows @ kernels @ columns.T)


def with_pitch(psf: FrozenPsf, pitch_um: float) -> FrozenPsf:
    """Return a PSF with samples of another pitch; the same one if that is its own."""
    ratio = psf.pixel_pitch_um / pitch_um
    if abs(ratio - 1) < SAME_PITCH:
        return psf
    return replace(
        psf,
        kernels=_at_ratio(psf.kernels, ratio),
        focus_kernels=None if psf.focus_kernels is None else _at_ratio(psf.focus_kernels, ratio),
        pixel_pitch_um=pitch_um,
    )


def for_sensor(psf: FrozenPsf, pitch_um: float, channels: int) -> FrozenPsf:
    """Return a measured PSF with the samples of a sensor, its distortion for every channel."""
    psf, bent = with_pitch(psf, pitch_um), psf.distortion
    if len(bent.coefficients) != 1 or channels == 1:
        return psf
    even = bent.even_coefficients
    rows = replace(
        bent,
        coefficients=np.tile(bent.coefficients, (channels, 1)),
        even_coefficients=None if even is None else np.tile(even, (channels, 1)),
    )
    return replace(psf, distortion=rows)


def _at_ratio(kernels: FloatArray, ratio: float) -> FloatArray:
    at_pitch = resampled_kernels(kernels.astype(np.float64), ratio)
    at_pitch /= at_pitch.sum((-2, -1), keepdims=True)
    return np.asarray(at_pitch, dtype=np.float32)


def window(kernels: FloatGrid, side_px: int) -> FloatGrid:
    """Cut or fill (..., h, w) up to the middle (..., side_px, side_px)."""
    for axis in (-2, -1):
        missing = (side_px - kernels.shape[axis]) // 2
        if missing < 0:
            kernels = np.moveaxis(np.moveaxis(kernels, axis, 0)[-missing:missing], 0, axis)
        elif missing:
            widths = [(0, 0)] * kernels.ndim
            widths[axis] = (missing, missing)
            kernels = np.pad(kernels, widths)
    return kernels


def _shares(side: int, ratio: float) -> FloatGrid:
    """Return (target, source): the share of each sample that falls into each one made."""
    half = int(np.ceil(side * ratio / 2 - 0.5))
    target_px = np.arange(-half, half + 1, dtype=np.float64)[:, None]
    source_px = (np.arange(side, dtype=np.float64)[None] - side // 2) * ratio
    low = np.maximum(target_px - 0.5, source_px - ratio / 2)
    high = np.minimum(target_px + 0.5, source_px + ratio / 2)
    return np.asarray(np.clip(high - low, 0, None) / ratio, dtype=np.float64)
