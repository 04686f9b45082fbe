"""Hot pixels: they count without light, far more than those around them.

A pixel is hot if its background is well above that of its neighbours, by more than chance explains,
and makes up most of what it counts: a bright surface raises the background too, by the tail of its
pulse, but never above its own signal. And it counts at all times: a second surface, which one
return takes for background, counts at its own time alone.
"""

from typing import Any, Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.cancel import check_wish

TIMES: Final = 5.0
"""Above the neighbours' background."""
SIGMAS: Final = 6.0
SHARE: Final = 0.5
"""Of a pixel's counts that are background."""
NEIGHBOURHOOD_PX: Final = 5
SPANS: Final = 8
"""Into which time is cut."""
FEW: Final = 2
"""Spans that may count less than the others: in more, a pixel sees surfaces; two of them fill four
spans at most."""
MOST_DEAD: Final = 0.5
MOST_ONE_BY_ONE: Final = 0.2
"""Of the pixels: the neighbours of more are sorted for all at once (measured)."""


def find_hot(
    background: NDArray[np.float64], cube: FloatArray, photons: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Find hot pixels.

    Args:
        background: (h, w) counts of a bin.
        cube: (h, w, bins) counts.
        photons: (h, w) their sums.

    Returns:
        (h, w).
    """
    bins = cube.shape[2]
    cuts = np.linspace(0, bins, SPANS, endpoint=False).astype(int)
    spans = np.add.reduceat(cube, cuts, axis=2)
    check_wish()
    at_all_times = np.partition(spans, FEW, axis=2)[..., FEW] * SPANS
    dark = np.minimum(background * bins, at_all_times)
    hot = (dark > SHARE * photons) & (dark > SIGMAS)
    dark, expected = dark[hot], _usual(background, hot) * bins
    excess = dark - expected > SIGMAS * np.sqrt(np.maximum(expected, 1.0))
    hot[hot] = excess & (dark > TIMES * expected)
    return np.asarray(hot)


def _usual(background: NDArray[np.float64], at: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the median (n,) around some of the pixels (h, w)."""
    if at.mean() > MOST_ONE_BY_ONE:
        whole = median_filter(background, size=NEIGHBOURHOOD_PX, mode="mirror")
        return np.asarray(whole[at])
    wide = np.pad(background, NEIGHBOURHOOD_PX // 2, mode="reflect")
    neighbours = sliding_window_view(wide, (NEIGHBOURHOOD_PX, NEIGHBOURHOOD_PX))[at]
    return np.asarray(np.median(neighbours.reshape(-1, NEIGHBOURHOOD_PX**2), axis=1))


def check_map(hot: NDArray[np.bool_]) -> None:
    """Refuse a map (h, w) of a whole array that is a map of something else.

    Raises:
        ContractError: If more than half of all pixels are hot.
    """
    if hot.mean() > MOST_DEAD:
        raise ContractError(
            f"{hot.mean():.0%} of the pixels are hot: more than half cannot be painted over"
        )


def painted_over(cube: NDArray[Any], hot: NDArray[np.bool_]) -> NDArray[Any]:
    """Return a cube whose hot pixels are the means of those around them that are not.

    Args:
        cube: (h, w, bins) or (h, w) counts.
        hot: (h, w), not all.

    Raises:
        ContractError: If the map has another shape, or nothing is left to paint with.
    """
    if hot.shape != cube.shape[:2]:
        raise ContractError(
            f"the map of hot pixels is {hot.shape[1]}x{hot.shape[0]}, the picture "
            f"{cube.shape[1]}x{cube.shape[0]}"
        )
    if hot.all():
        raise ContractError("every pixel is hot: there is nothing to paint them over with")
    painted = cube.copy()
    for y, x in np.argwhere(hot):
        check_wish()
        reach = 1
        while True:
            rows = slice(max(0, y - reach), y + reach + 1)
            columns = slice(max(0, x - reach), x + reach + 1)
            sound = ~hot[rows, columns]
            if sound.any():
                break
            reach += 1
        painted[y, x] = cube[rows, columns][sound].mean(axis=0)
    return painted
