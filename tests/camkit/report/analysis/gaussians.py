"""Images of points that are Gaussians, and a quiet sensor."""

import numpy as np
from numpy.typing import NDArray

from camkit.report.analysis.point_image import PATCH_PX, PointImage

FLOAT = np.float64


def gaussian_line(sigma_px: float, reach_px: int = 200) -> NDArray[np.float64]:
    """Give samples of a Gaussian, of sum 1."""
    line = np.exp(-0.5 * (np.arange(-reach_px, reach_px + 1) / sigma_px) ** 2)
    return np.asarray(line / line.sum())


def gaussian_image(sigma_px: float, *, illumination: float = 1.0) -> PointImage:
    """Give a round Gaussian on the axis; its shares near and far are not those of a trace."""
    line = gaussian_line(sigma_px, PATCH_PX)
    return PointImage(
        height_mm=0.0,
        field_angle_rad=0.0,
        patch=np.outer(line, line),
        lines={"radial": gaussian_line(sigma_px), "tangential": gaussian_line(sigma_px)},
        near_share=1.0,
        far_share=1.0,
        illumination=illumination,
    )
