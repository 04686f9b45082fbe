"""The uncertainty of measured kernels, estimated, and kernels drawn within it.

What does not vary smoothly over the field is taken for an error of the measurement: of the places
of colours against each other, and of the widths of kernels. Noise is the scatter along the border.
An error that all kernels share, such as another focus, shows in none of these; the least values of
`camkit.psf.PsfUncertainty` stand for it.

A drawn PSF has, all Gaussian: one change of size for all kernels; a shift of every field and
colour, less the mean of the colours, which would move the picture and blur nothing; noise of every
sample by the root of its light. Negative values are cut, and every kernel sums to 1 again.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.psf_import.kernel_stack import FloatGrid
from camkit.psf import FrozenPsf, PsfUncertainty

LEAST_SPARE: Final = 3
"""Fields more than numbers that are fitted."""
MOST: Final = 0.5


def estimate_uncertainty(psf: FrozenPsf, noise: float) -> PsfUncertainty:
    """Return the uncertainty of kernels, at least that of `PsfUncertainty`.

    Args:
        psf: Of one depth.
        noise: Scatter along the border, of the peak.
    """
    least = PsfUncertainty()
    kernels = psf.kernels[:, 0].astype(np.float64)
    power = kernels**2
    total = power.sum((-2, -1))
    half = kernels.shape[-1] // 2
    offsets = np.arange(-half, half + 1)
    x_px, y_px = (power.sum(axis) @ offsets / total for axis in (-2, -1))
    shifts = np.stack([c - c.mean(axis=1, keepdims=True) for c in (x_px, y_px)], axis=-1)
    widths = -0.5 * np.log(total)
    shift_px = max(_residual(shifts[:, c], psf, order=1) for c in range(shifts.shape[1]))
    width = max(_residual(widths[:, c, None], psf, order=2) for c in range(widths.shape[1]))
    return PsfUncertainty(
        noise=min(max(noise, least.noise), MOST),
        shift_px=min(max(shift_px, least.shift_px), MOST),
        width=min(max(width, least.width), MOST),
    )


def _residual(values: FloatGrid, psf: FrozenPsf, *, order: int) -> float:
    """Return the RMS of what a polynomial over the field leaves; 0 where there are few fields."""
    if psf.grid_x_mm is not None and psf.grid_y_mm is not None:
        y, x = (a.ravel() for a in np.meshgrid(psf.grid_y_mm, psf.grid_x_mm, indexing="ij"))
    else:
        x, y = np.zeros_like(psf.field_heights_mm), psf.field_heights_mm
    x, y = (axis / max(float(np.abs(axis).max()), 1e-12) for axis in (x, y))
    terms = [x**i * y**j for i in range(order + 1) for j in range(order + 1 - i)]
    basis = np.stack(terms, axis=1)
    rank = int(np.linalg.matrix_rank(basis))
    if len(values) < rank + LEAST_SPARE:
        return 0.0
    rest = values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    return float(np.sqrt(np.square(rest).sum(axis=0).max() / (len(values) - rank)))


def drawn_psf(psf: FrozenPsf, uncertainty: PsfUncertainty, rng: np.random.Generator) -> FrozenPsf:
    """Return a PSF that a measurement of this uncertainty may have missed; focus is nominal."""
    kernels = psf.kernels.astype(np.float64)
    fields, depths, colours = kernels.shape[:3]
    size = float(np.exp(rng.normal() * uncertainty.width))
    shifts = rng.normal(size=(2, fields, colours)) * uncertainty.shift_px
    if colours > 1:
        shifts -= shifts.mean(axis=-1, keepdims=True)
    else:
        shifts[:] = 0
    moved_kernels = np.empty_like(kernels)
    for field, colour in np.ndindex(fields, colours):
        rows, columns = (
            _resampling(side, size, float(shift))
            for side, shift in zip(kernels.shape[-2:], shifts[:, field, colour], strict=True)
        )
        for depth in range(depths):
            moved_kernels[field, depth, colour] = rows @ kernels[field, depth, colour] @ columns.T
    moved_kernels = np.clip(moved_kernels, 0, None)
    peaks = moved_kernels.max(axis=(-2, -1), keepdims=True)
    scatter = rng.normal(size=kernels.shape) * uncertainty.noise
    moved_kernels = np.clip(moved_kernels + scatter * np.sqrt(moved_kernels * peaks), 0, None)
    moved_kernels /= moved_kernels.sum(axis=(-2, -1), keepdims=True)
    return replace(psf, kernels=moved_kernels.astype(np.float32), focus_um=None, focus_kernels=None)


def _resampling(side: int, size: float, shift: float) -> NDArray[np.float64]:
    """Return (target, source) weights of Catmull-Rom taps: scaled about the middle, then moved."""
    middle = side // 2
    target_px = (np.arange(side)[:, None] - middle - shift) / size + middle
    t = np.abs(target_px - np.arange(side)[None])
    near = 1 - 2.5 * t**2 + 1.5 * t**3
    far = 2 - 4 * t + 2.5 * t**2 - 0.5 * t**3
    return np.where(t < 1, near, np.where(t < 2, far, 0.0))
