"""PU21: luminance as the eye tells it apart, and PSNR and SSIM of what is encoded so.

    linear Rec.709 -> cd/m^2, each colour cut to the range -> luminance -> PU21 -> PSNR
                                                        `---> PU21 -> luma -> SSIM

Both are defined as the authors' package `cvvdp` defines them, so that numbers can be compared; 100
cd/m^2, the white of an ordinary display, is the peak.

References: Mantiuk and Azimi, "PU21: A novel perceptually uniform encoding for adapting existing
quality metrics for HDR", PCS 2021; luminance: dissertation, eq. (2.1).
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import D65, REC709_PRIMARIES, rgb_to_xyz
from camkit.report.image_scores import structural_similarity

BANDING_GLARE: Final = (
    *(0.353487901, 0.3734658629, 8.277049286e-05, 0.9062562627),
    *(0.09150303166, 0.9099517204, 596.3148142),
)
"""Parameters p1..p7 of the variant with glare, which the authors recommend."""
LEAST_NITS: Final = 0.005
MOST_NITS: Final = 10_000.0
"""The range of the encoding in cd/m^2; what lies outside is cut."""
WHITE_NITS: Final = 100.0

FloatGrid = NDArray[np.float64]


def pu21(nits: ArrayLike) -> FloatGrid:
    """Encode luminance.

    Args:
        nits: In cd/m^2; cut to `LEAST_NITS`..`MOST_NITS`.

    Returns:
        Values from 0, float64; 100 cd/m^2 are 256.4 and 10,000 are 595.4.

    References: Mantiuk and Azimi 2021.
    """
    p1, p2, p3, p4, p5, p6, p7 = BANDING_GLARE
    y = np.clip(np.asarray(nits, dtype=np.float64), LEAST_NITS, MOST_NITS) ** p4
    return np.asarray(p7 * (((p1 + p2 * y) / (1 + p3 * y)) ** p5 - p6))


def pu21_mean_square(result: FloatArray, truth: FloatArray, nits_per_unit: float) -> float:
    """Return the mean squared difference of encoded luminance, where encoded white is 1.

    Args:
        result: (3, h, w) linear Rec.709.
        truth: Likewise.
        nits_per_unit: Luminance of white (1.0) in cd/m^2.
    """
    got, reference = (pu21(_luminance(_luminous(p, nits_per_unit))) for p in (result, truth))
    return float(np.mean(np.square((got - reference) / _WHITE)))


def pu21_ssim(result: FloatArray, truth: FloatArray, nits_per_unit: float) -> float:
    """Return SSIM of the luma of encoded colours; arguments as of `pu21_mean_square`.

    References: Wang et al. 2004 (SSIM with Gaussian weights of sigma 1.5).
    """
    got, reference = (
        _luminance(pu21(_luminous(p, nits_per_unit)) / _WHITE) for p in (result, truth)
    )
    return float(
        structural_similarity(
            reference,
            got,
            data_range=1.0,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
        )
    )


def _luminous(linear: FloatArray, nits_per_unit: float) -> FloatGrid:
    return np.clip(linear.astype(np.float64) * nits_per_unit, LEAST_NITS, MOST_NITS)


def _luminance(colors: FloatGrid) -> FloatGrid:
    """Return the weighted sum (h, w) of Rec.709 colours (3, h, w)."""
    return np.asarray(np.tensordot(_WEIGHTS, colors, axes=1))


_WEIGHTS: Final = np.asarray(rgb_to_xyz(REC709_PRIMARIES, D65))[1]
_WHITE: Final = pu21(WHITE_NITS)
