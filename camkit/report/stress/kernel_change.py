"""Kernels enlarged and turned, as a lens copy has them."""

import cv2
import numpy as np

from camkit.contracts import FloatArray


def transform_kernels(kernels: FloatArray, scale: float, angle_rad: float) -> FloatArray:
    """Enlarge and turn kernels about their middle, by bicubic interpolation.

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
