"""PSNR and SSIM of a picture beside the truth, over its whole area, white = 1.

References: Wang, Bovik, Sheikh, Simoncelli 2004: SSIM, Gaussian of 1.5 px in 11x11.
"""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.report.image_scores import structural_similarity

MOST_DB: Final = 100.0
SIGMA_PX: Final = 1.5
SIDE_PX: Final = 11


def psnr_db(picture: FloatArray, truth: FloatArray) -> float:
    """Return the PSNR in dB, at most `MOST_DB`."""
    error = float(np.mean((picture.astype(np.float64) - truth) ** 2))
    return min(float(-10 * np.log10(max(error, 1e-30))), MOST_DB)


def ssim(picture: FloatArray, truth: FloatArray) -> float:
    """Return the mean SSIM of pictures (h, w), windows that reach over the border left out."""
    return float(
        structural_similarity(
            truth.astype(np.float64),
            picture.astype(np.float64),
            data_range=1.0,
            gaussian_weights=True,
            sigma=SIGMA_PX,
            win_size=SIDE_PX,
            use_sample_covariance=False,
        )
    )
