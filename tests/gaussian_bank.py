"""A bank of PSFs without a lens, for tests of the training."""

import numpy as np

from camkit.models_def.kinds.bayer.psf_bank import PsfBank


def gaussian_bank(*, sensor_height_mm: float, axis_px: float, corner_px: float) -> PsfBank:
    """Make a bank without a lens: elliptical Gaussians that grow over the field.

    The two copies differ by 4 % in width.

    Args:
        sensor_height_mm: Greatest field height.
        axis_px: Standard deviation on the axis.
        corner_px: Radial standard deviation at the corner; across it is half of that.
    """
    heights = np.linspace(0.0, sensor_height_mm, 5)
    reach = int(3 * 1.04 * corner_px) + 2
    offsets = np.arange(-reach, reach + 1, dtype=np.float64)
    copies = []
    for factor in (1.0, 1.04, 0.97):
        kernels = []
        for share in heights / sensor_height_mm:
            along = factor * (axis_px + (corner_px - axis_px) * share)
            across = factor * (axis_px + (0.5 * corner_px - axis_px) * share)
            kernel = np.exp(
                -0.5 * ((offsets[:, None] / along) ** 2 + (offsets[None, :] / across) ** 2)
            )
            kernels.append(np.stack([kernel / kernel.sum()] * 3))
        copies.append(np.stack(kernels))
    bank = np.stack(copies).astype(np.float32)
    return PsfBank(
        copies=bank[1:],
        copy_heights_mm=heights,
        frozen=bank[0],
        frozen_heights_mm=heights,
        relative_illumination=1 - 0.4 * (heights / sensor_height_mm) ** 2,
    )
