"""Kernels enlarged and turned, as a lens copy has them; the haze beside them too."""

from dataclasses import replace

import cv2
import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.twin.haze_spread import HazeLens
from camkit.runtime.twin.light import KernelChange, Lens, with_kernels


def transform_kernels(kernels: FloatArray, scale: float, angle_rad: float) -> FloatArray:
    """Scale and rotate kernels about their middle, by bicubic interpolation.

    Args:
        kernels: (c, h, w).
        scale: > 1 makes them wider.
        angle_rad: From +x towards +y.
    """
    c, s = scale * np.cos(angle_rad), scale * np.sin(angle_rad)
    matrix = np.array([[c, -s], [s, c]])  # acts on (x, y)
    size = (kernels.shape[-1], kernels.shape[-2])
    middle = (np.array(size) - 1) / 2
    affine = np.column_stack([matrix, middle - matrix @ middle])
    return np.stack([cv2.warpAffine(k, affine, size, flags=cv2.INTER_CUBIC) for k in kernels])


def with_transformed(lens: Lens, scale: float, angle_rad: float) -> Lens:
    """Return lens all of whose kernels are enlarged and turned, those of its haze with their light.

    Args:
        lens: The lens.
        scale: > 1 makes kernels wider.
        angle_rad: From +x towards +y.
    """

    def change(kernels: FloatArray) -> FloatArray:
        return transform_kernels(kernels, scale, angle_rad)

    changed = with_kernels(lens, change)
    if lens.haze is None:
        return changed
    return replace(changed, haze=_with_haze_kernels(lens.haze, change))


def _with_haze_kernels(haze: HazeLens, change: KernelChange) -> HazeLens:
    """Return a haze whose kernels are changed and hold as much light as before."""

    def haze_at(x_mm: float, y_mm: float) -> FloatArray:
        kernels = haze.haze_at(x_mm, y_mm)
        changed = np.maximum(change(kernels), 0)
        light, total = (k.sum(axis=(-2, -1), keepdims=True) for k in (kernels, changed))
        return np.asarray(changed * (light / np.where(total > 0, total, 1)), dtype=np.float32)

    return replace(haze, haze_at=haze_at)
