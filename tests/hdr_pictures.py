"""A picture of ten stops in closed form and a result beside it, for the scores of HDR."""

import numpy as np

from camkit.arrays import FloatArray


def hdr_pair(side_px: int = 64) -> tuple[FloatArray, FloatArray]:
    """Give (result, truth) (3, side, side): colours a stop apart up to 2^8, ripples of 20 %."""
    y, x = np.mgrid[:side_px, :side_px]
    color = np.arange(3)[:, None, None]
    truth = 2.0 ** (8 * (x + y) / (2 * side_px - 2) - color)
    result = truth * (1 + 0.2 * np.sin(x / 3 + color))
    return result.astype(np.float32), truth.astype(np.float32)
