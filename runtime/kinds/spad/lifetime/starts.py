"""Starts for fits of lifetimes: the best of a coarse bank over lifetimes and times.

A look that assumes too little background takes it for a slow decay, so there are several looks.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.spad.lifetime.decay import Decay, Floats
from camkit.runtime.kinds.spad.time_axis import TimeAxis

LIFETIME_STEP: Final = 1.7
"""Factor between two lifetimes."""
STEP_SIGMAS: Final = 2.0
"""Of the pulse's edge: between two times, a bin at least."""
MOST_TIMES: Final = 400
MOST_BINS: Final = 2 * MOST_TIMES
"""Templates so far apart need no finer bins; finer ones are put together."""
DARK_SHARES: Final = (0.1, 0.5, 0.9)
"""Of the photons: background that looks assume."""


class Starts:
    """A coarse bank.

    Attributes:
        mu_ps: (m,) times of its templates.
        lifetime_ps: (m,) their lifetimes.
        length: How far normed templates turn along time, all lifetimes together: how much there is
            to search, see `camkit.runtime.kinds.spad.evidence`.
    """

    def __init__(self, decay: Decay, least_ps: float, most_ps: float) -> None:
        """Compute templates over an axis, for lifetimes between two limits."""
        axis, self._decay = decay.axis, decay
        group = -(-axis.bins // MOST_BINS)
        self._first = np.arange(0, axis.bins, group)
        edges = axis.edges_ps[np.append(self._first, axis.bins)]
        coarse = replace(decay, axis=TimeAxis(orientation=axis.orientation, edges_ps=edges))
        count = max(2, int(np.ceil(np.log(most_ps / least_ps) / np.log(LIFETIME_STEP))) + 1)
        lifetimes = np.geomspace(least_ps, most_ps, count)
        span = float(axis.centres_ps[-1] - axis.centres_ps[0])
        step = max(STEP_SIGMAS * decay.pulse.finest_ps, axis.step_ps, span / MOST_TIMES)
        times = axis.centres_ps[0] - decay.pulse.mean_ps + np.arange(0, span, step)
        self.mu_ps = np.tile(times, count)
        self.lifetime_ps = np.repeat(lifetimes, len(times))
        shares = np.concatenate(
            [coarse.shapes(times, np.full(len(times), tau)).shares for tau in lifetimes]
        )
        visible = np.maximum(shares.sum(axis=1, keepdims=True), 1e-9)
        even = np.diff(np.append(self._first, axis.bins)) / axis.bins
        self._logs = [
            np.log((1 - dark) * shares / visible + dark * even).T.astype(np.float32)
            for dark in DARK_SHARES
        ]
        self.length = sum(_turned(part) for part in np.split(shares, count))
        self._shares = shares if group == 1 else None

    def best(self, counts: FloatArray) -> list[NDArray[np.int64]]:
        """Return the likeliest template of every pixel, by every look."""
        if self._shares is None:
            counts = np.add.reduceat(counts, self._first, axis=1)
        return [(counts @ logs).argmax(axis=1) for logs in self._logs]

    def shares(self, templates: NDArray[np.int64]) -> Floats:
        """Return what every bin of the axis sees of some templates, (p, bins)."""
        if self._shares is not None:
            return np.asarray(self._shares[templates])
        return self._decay.shapes(self.mu_ps[templates], self.lifetime_ps[templates]).shares


def _turned(shares: Floats) -> float:
    centred = shares - shares.mean(axis=1, keepdims=True)
    normed = centred / np.maximum(np.linalg.norm(centred, axis=1, keepdims=True), 1e-300)
    return float(np.arccos(np.clip((normed[1:] * normed[:-1]).sum(axis=1), -1, 1)).sum())
