"""Pixels of a decoded file that stand out alone: hot pixels, or damage within the pixel data.

far outside the four neighbours of the same colour   whole numbers, every pixel
-> far outside all eight, measured by their spread    noise and edges end here
-> the other colours beside it show nothing           light ends here, which a lens spreads
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.files.raw_checks import Levels, Samples
from camkit.runtime.signal.glow import MARGIN_PX, OUTLIER_SPREADS, glows, neighbours

OUTLIER_STEP: Final = 0.1
BAND_ROWS: Final = 32


def count_lone(samples: Samples, levels: Levels, cell: int) -> int:
    """Count pixels that stand out alone, by more than `OUTLIER_STEP` of the range.

    Args:
        samples: (h, w) uint8 or uint16.
        levels: Black and white level.
        cell: Distance to the next pixel of the same colour: 2 in a Bayer mosaic, 1 in a plane.
    """
    height, width = samples.shape
    if min(height, width) <= 2 * MARGIN_PX:
        return 0
    step = max(1, round(OUTLIER_STEP * (levels.white - float(levels.black.min()))))
    tops = range(MARGIN_PX, height - MARGIN_PX, BAND_ROWS)
    return sum(
        _lone(samples[top - MARGIN_PX : min(top + BAND_ROWS, height - MARGIN_PX) + MARGIN_PX],
              cell, step)
        for top in tops
    )  # fmt: skip


def _lone(band: Samples, cell: int, step: int) -> int:
    """Count the lone pixels of a band within its margin."""
    rows, cols = np.nonzero(_apart_from_four(band, cell, step))
    if not rows.size:
        return 0
    light = band.astype(np.float32)
    ring = neighbours(light, rows, cols, cell)
    high, low = ring.max(axis=0), ring.min(axis=0)
    value = light[rows + MARGIN_PX, cols + MARGIN_PX]
    distance = np.maximum(value - high, low - value)
    lone = distance > np.maximum(OUTLIER_SPREADS * (high - low), step)
    if cell == 2:
        lone &= ~glows(light, rows, cols)
    return int(np.count_nonzero(lone))


def _apart_from_four(band: Samples, cell: int, step: int) -> NDArray[np.bool_]:
    """Find pixels of a band, within its margin, that lie far outside four neighbours."""
    if band.dtype != np.uint16:
        band = band.astype(np.uint16)
    height, width = (side - 2 * MARGIN_PX for side in band.shape)

    def shifted(dy: int, dx: int) -> NDArray[Any]:
        top, left = MARGIN_PX + dy, MARGIN_PX + dx
        return band[top : top + height, left : left + width]

    inner = shifted(0, 0)
    sides = (shifted(-cell, 0), shifted(cell, 0), shifted(0, -cell), shifted(0, cell))
    above = np.maximum(sides[0], sides[1])
    np.maximum(above, np.maximum(sides[2], sides[3]), out=above)
    below = np.minimum(sides[0], sides[1])
    np.minimum(below, np.minimum(sides[2], sides[3]), out=below)
    # unsigned numbers wrap, so each difference is taken from a bound that is never crossed
    high = np.maximum(inner, above) - above > step
    low = below - np.minimum(inner, below) > step
    return np.asarray(high | low)
