"""Whether pixels lie inside the surface that their square of neighbours shows, or beside it.

Beside an edge every square holds a return, and the chance that a pixel's own few photons happen to
agree with it is large. A pixel is inside where its own photons agree and those of every half of the
square around it prove the return too: beside a straight edge one half lies in the empty part. A
pixel that is not proves the return by its own photons.

    halves, own pixel left out:   up, down, left, right and the four diagonal ones
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from camkit.contracts import FloatArray
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.fit import Fit, Fitter

LEAST_BACKGROUND: Final = 1e-3
"""Counts of a bin; no detector is darker for certain."""
AT_ONCE: Final = 65_536
"""Pixels that are looked at at once."""
DIRECTIONS: Final = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))


def least_gain(rate: float) -> float:
    """Return the gain at a given place and size that background alone exceeds at most at a rate.

    A log likelihood ratio between two normal distributions d standard deviations apart is normal,
    -d^2 / 2 on average, with a standard deviation of d: it exceeds g with the chance
    Q(g / d + d / 2), which is largest where d^2 = 2 g, Q(sqrt(2 g)).

    Args:
        rate: Of false alarms, in 0..0.5, both left out.
    """
    return float(ndtri(rate) ** 2 / 2)


def are_believed(
    fitter: Fitter,
    cube: FloatArray,
    sound: NDArray[np.bool_] | None,
    rows: NDArray[np.int64],
    fit: Fit,
    side: int,
    rate: float,
) -> NDArray[np.bool_]:
    """Return which pixels may take what their squares found.

    Args:
        fitter: The bank.
        cube: (h, w, bins) counts.
        sound: (h, w) pixels that count; None for all.
        rows: (p,) flat numbers of the pixels.
        fit: What their squares found, amplitude and background of one pixel.
        side: Of the squares.
        rate: Of false alarms.
    """
    # two ways to be believed share the rate
    least, found = least_gain(rate / 2), np.zeros(len(rows), dtype=bool)
    names = ("template", "amplitude", "background")
    for start in range(0, len(rows), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        own = tuple(getattr(fit, name)[part] for name in names)
        gains = _gains(fitter, cube, sound, rows[part], own, side)
        middle = side // 2
        alone = gains[:, middle, middle].copy()
        gains[:, middle, middle] = 0
        places = np.arange(side) - middle
        halves = [
            gains[:, dy * places[:, None] + dx * places >= 0].sum(axis=1) for dy, dx in DIRECTIONS
        ]
        is_inside = (alone > 0) & (np.min(halves, axis=0) > least)
        found[part] = is_inside | (alone > least)
    return found


def _gains(
    fitter: Fitter,
    cube: FloatArray,
    sound: NDArray[np.bool_] | None,
    rows: NDArray[np.int64],
    own: tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]],
    side: int,
) -> NDArray[np.float64]:
    """Return how much each pixel of the squares speaks for the pulse, (p, side, side).

    What lies beyond the border, or is not sound, says nothing.
    """
    template, amplitude, background = own
    bank, (height, width, _) = fitter.bank, cube.shape
    dark = np.maximum(background, LEAST_BACKGROUND)
    logs = np.log1p(amplitude[:, None] * bank.shares[template] / dark[:, None])
    unseen = amplitude * bank.totals[template]
    bins, reach = bank.bins[template], side // 2
    y, x = np.divmod(rows, width)
    found = np.zeros((len(rows), side, side))
    for dy in range(side):
        check_wish()
        for dx in range(side):
            at_y, at_x = y + dy - reach, x + dx - reach
            there = (at_y >= 0) & (at_y < height) & (at_x >= 0) & (at_x < width)
            if sound is not None:
                there[there] = sound[at_y[there], at_x[there]]
            counts = cube[at_y[there, None], at_x[there, None], bins[there]]
            found[there, dy, dx] = (counts * logs[there]).sum(axis=1) - unseen[there]
    return found
