"""Filters that nearly undo a blur which differs from cell to cell, each for its own place.

    kernels of nodes -> their Wiener filters in cells -> few kernels, as those of the blur

One filter for all places makes errors smaller while |1 - W K| < 1 for every kernel K. Detail of a
cell lives on what the core holds: where the core of a place holds more than twice the mean, the
filter of the mean kernel makes the errors there larger with every round.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.haze import Haze
from camkit.runtime.cancel import check_wish

MOST_OF_MEAN: Final = 2.0
"""Light of the fullest core over the mean core, up to which one filter serves all places."""
DAMPING: Final = 1e-2
"""Added to the power of every kernel; less takes more rounds to settle than it is worth."""


def cores_differ(haze: Haze) -> bool:
    """Return whether every place needs a filter of its own.

    Fields on a line stand for the rings between them, others for equal areas.

    Args:
        haze: Its cores say how much light they hold.
    """
    share = haze.core_share.mean(axis=(1, 2))
    heights_mm = haze.field_heights_mm
    area = np.ones(share.size)
    if share.size > 1 and (np.diff(heights_mm) > 0).all():
        middles = (heights_mm[1:] + heights_mm[:-1]) / 2
        edges = np.concatenate([heights_mm[:1], middles, heights_mm[-1:]])
        area = np.diff(np.square(edges))
    return bool(share.max() > MOST_OF_MEAN * np.average(share, weights=area))


def filter_side(side: int) -> int:
    """Return the side in cells of the filter of a kernel."""
    return 2 * side - 1


def undoing_kernels(kernels: FloatArray) -> FloatArray:
    """Return the Wiener filter of every kernel, made to hold all light.

    Args:
        kernels: (node, n, n), n odd.

    Returns:
        (node, m, m) float32, m by `filter_side`.
    """
    import scipy.fft

    side = kernels.shape[-1]
    full = scipy.fft.next_fast_len(3 * side, real=True)
    place = np.arange(side) - side // 2
    wide = filter_side(side)
    taps = np.arange(wide) - wide // 2
    filters = np.empty((len(kernels), wide, wide), np.float32)
    for kernel, filtered in zip(kernels, filters, strict=True):
        check_wish()
        padded = np.zeros((full, full))
        padded[np.ix_(place, place)] = kernel / max(float(kernel.sum()), 1e-12)
        spectrum: NDArray[np.complex128] = scipy.fft.rfft2(padded)
        gain = np.conj(spectrum) / (np.square(np.abs(spectrum)) + DAMPING)
        filtered[:] = scipy.fft.irfft2(gain, (full, full))[np.ix_(taps, taps)]
    return filters
