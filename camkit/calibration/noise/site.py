"""Statistics of a pair of frames, for one colour: its means, its noise in time, its fixed pattern.

    blocks of 32x32 less a plane each -> difference: noise in time, product: fixed pattern

A plane fitted to each block takes uneven light and bands of a lamp with it. The second frame is
brought to the mean of the first, so that a fixed pattern cancels although the lamp drifted:

    a = s, b = q s with q = b / a, r = 1 / q:   var(a - r b) = K a (1 + r) + v (1 + r^2)

for the gain K in DN per electron and the variance v in the dark. Divided by 1 + r^2 that is the
variance of one frame at the signal a (1 + r) / (1 + r^2).

References: EMVA 1288 release 4.0, ch. 6 and 8 (variance of differences, high-pass).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatGrid = NDArray[np.float64]

BLOCK_PX: Final = 32
MOST_SPREADS: Final = 8.0
"""A sample this far from its neighbours is a defect, not noise."""
_MAD_TO_SIGMA: Final = 1.4826
_PLANE_TERMS: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class SitePair:
    """One colour of a pair, in DN above the stated black.

    Attributes:
        mean: Of the first frame.
        second_mean: Of the second.
        lit: Mean of the first less the dark; 0 of dark frames themselves.
        signal: At which `variance` is that of one frame; in the dark the mean of both.
        variance: Of the noise in time, rounding included, in DN^2.
        pattern: Variance of what both frames share beside smooth light, at the light of the first,
            in DN^2; noise may make it negative.
        samples: That stand behind both variances.
        defects: Samples left out.
    """

    mean: float
    second_mean: float
    lit: float
    signal: float
    variance: float
    pattern: float
    samples: int
    defects: int


def site_pair(first: FloatGrid, second: FloatGrid, dark: float | None, step: float) -> SitePair:
    """Return the statistics of one colour in two frames.

    Args:
        first: (h, w) DN above the stated black, h and w at least `BLOCK_PX`.
        second: Likewise.
        dark: Mean of dark frames, likewise; None if these are dark frames themselves.
        step: Of the converter, in DN.
    """
    mean, second_mean = float(first.mean()), float(second.mean())
    ratio, lit, signal = 1.0, 0.0, (mean + second_mean) / 2
    if dark is not None:
        lit = mean - dark
        ratio = lit / (second_mean - dark)
        signal = lit * (1 + ratio) / (1 + ratio**2)
    one, two = _blocks(first), _blocks(second) * ratio
    difference, defects = _without_defects(one - two, step)
    shared, broken = _without_defects((one + two) / 2, step)
    left_out = defects | broken
    freedom = 1 - _PLANE_TERMS / one.shape[1]
    count = freedom * np.count_nonzero(~left_out)
    noise = float((difference[~left_out] ** 2).sum() / count)
    mixed = float((shared[~left_out] ** 2).sum() / count)
    return SitePair(
        mean=mean,
        second_mean=second_mean,
        lit=lit,
        signal=signal,
        variance=noise / (1 + ratio**2),
        # ((a + rb)/2)^2 - ((a - rb)/2)^2 is their product
        pattern=mixed - noise / 4,
        samples=int(count),
        defects=int(np.count_nonzero(left_out)),
    )


def _blocks(plane: FloatGrid) -> FloatGrid:
    """Return (block, sample), without the incomplete blocks at the right and lower border."""
    rows, columns = (n // BLOCK_PX for n in plane.shape)
    whole = plane[: rows * BLOCK_PX, : columns * BLOCK_PX]
    tiled = whole.reshape(rows, BLOCK_PX, columns, BLOCK_PX).swapaxes(1, 2)
    return tiled.reshape(rows * columns, BLOCK_PX**2)


def _without_defects(blocks: FloatGrid, step: float) -> tuple[FloatGrid, NDArray[np.bool_]]:
    """Return blocks without their planes, and where a sample is a lone defect."""
    rest = blocks - _planes(blocks)
    limit = MOST_SPREADS * max(_MAD_TO_SIGMA * float(np.median(np.abs(rest))), step / 2)
    is_defect = np.abs(rest) > limit
    if is_defect.any():
        rest = blocks - _planes(np.where(is_defect, blocks - rest, blocks))
        is_defect = np.abs(rest) > limit
    return rest, is_defect


def _planes(blocks: FloatGrid) -> FloatGrid:
    """Return the plane fitted to each block."""
    y, x = np.mgrid[:BLOCK_PX, :BLOCK_PX].reshape(2, -1) - (BLOCK_PX - 1) / 2
    plane, _ = np.linalg.qr(np.stack([np.ones(BLOCK_PX**2), y, x], axis=1))
    return np.asarray((blocks @ plane) @ plane.T)
