"""Templates of a bank at any time of flight: cubics through the shares and slopes beside it.

Templates lie a quarter of an edge apart, so that the cubic of Hermite misses a Gaussian by
3 / (384 * 4^4) of its peak at most, 3 parts in 100,000.
"""

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.kinds.spad.bank import Bank

Floats = NDArray[np.float64]


class TemplateCubics:
    """The coefficients of cubics between the templates of a bank, side by side."""

    def __init__(self, bank: Bank) -> None:
        self._bank = bank
        starts = bank.bins[:, 0]
        ahead = np.diff(starts)
        self._width = bank.bins.shape[1] + int(ahead.max(initial=0))
        count = len(starts) - 1
        begins = np.zeros((2, count, self._width))
        ends = np.zeros((2, count, self._width))
        columns = np.arange(bank.bins.shape[1])
        for index, values in enumerate((bank.shares, bank.slopes * bank.step_ps)):
            begins[index, :, : len(columns)] = values[:-1]
            rows = np.arange(count)[:, None]
            ends[index, rows, ahead[:, None] + columns] = values[1:]
        self._begins, self._ends, self._starts = begins, ends, starts[:-1]

    def shapes(self, mu_ps: Floats) -> tuple[Floats, Floats]:
        """Return shares, and their slopes by time (1/ps), of every bin.

        Args:
            mu_ps: (p,) times of flight between the first and the last template.

        Returns:
            (p, bins) each.
        """
        bank = self._bank
        place = (mu_ps - bank.mu_ps[0]) / bank.step_ps
        m = np.clip(place.astype(np.int64), 0, len(self._starts) - 1)
        t = (place - m)[:, None]
        s0, d0 = self._begins[0, m], self._begins[1, m]
        s1, d1 = self._ends[0, m], self._ends[1, m]
        rise = s1 - s0
        c2, c3 = 3 * rise - 2 * d0 - d1, d0 + d1 - 2 * rise
        values = s0 + t * (d0 + t * (c2 + t * c3))
        slopes = (d0 + t * (2 * c2 + t * (3 * c3))) / bank.step_ps
        columns = np.minimum(self._starts[m][:, None] + np.arange(self._width), bank.axis.bins)
        whole = np.zeros((2, len(m), bank.axis.bins + 1))
        rows = np.arange(len(m))[:, None]
        whole[0, rows, columns] = np.maximum(values, 0.0)
        whole[1, rows, columns] = slopes
        return whole[0, :, :-1], whole[1, :, :-1]
