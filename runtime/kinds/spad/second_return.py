"""A second surface where the residual of one asks for it and the likelihood proves it.

A pixel that took the photons of a square sees the surfaces of its neighbours too: there the
pixel's own photons must speak for either return beside the other.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.evidence import threshold_for
from camkit.runtime.kinds.spad.fit import Fit, Fitter
from camkit.runtime.kinds.spad.pooling import Pooled, Squares, fit_of_rows
from camkit.runtime.kinds.spad.surroundings import LEAST_BACKGROUND
from camkit.runtime.kinds.spad.two_returns import TwoFitter, TwoReturns

Arrays = dict[str, NDArray[Any]]


class SecondReturns:
    """Looks for second returns behind fits of one."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter

    @cached_property
    def _two(self) -> TwoFitter:
        return TwoFitter(self._fitter.bank)

    def added(
        self,
        arrays: Mapping[str, NDArray[Any]],
        pooled: Pooled,
        cube: FloatArray,
        sound: NDArray[np.bool_],
        false_alarms: float,
    ) -> Arrays:
        """Return arrays of one return (1, h, w) with a second layer.

        Where no second return is proved the layer has the time of the first, no photons, and is
        not valid.

        Args:
            arrays: Arrays by the names of `Sharpened`.
            pooled: The fits of one return, and the squares that they took.
            cube: (h, w, bins) counts.
            sound: (h, w) pixels whose photons count in squares.
            false_alarms: Rate per pixel at which a second return is believed that is none.
        """
        layers = {name: np.concatenate([values, values]) for name, values in arrays.items()}
        for name in ("amplitude", "evidence", "valid", "pooled"):
            layers[name][1] = 0
        threshold = threshold_for(false_alarms, self._fitter.search_length)
        valid = arrays["valid"].ravel()
        pixel_counts = cube.reshape(-1, cube.shape[2])
        for side in np.unique(pooled.side[valid]):
            check_wish()
            rows = np.flatnonzero(valid & (pooled.side == side))
            squares = None if side == 1 else Squares(cube, int(side), sound)
            counts = pixel_counts[rows] if squares is None else squares.counts(rows)
            members = np.ones(len(rows)) if squares is None else squares.members[rows]
            one = _of_square(fit_of_rows(pooled.fit, rows), members)
            check_wish()
            asks = self._two.asks_for_second(counts, one)
            rows, members, one = rows[asks], members[asks], fit_of_rows(one, np.flatnonzero(asks))
            check_wish()
            two = self._two.fit(counts[asks], one)
            proved = two.evidence > threshold
            if side > 1:
                proved &= self._speak_for_both(pixel_counts[rows], two, members)
            _store(layers, rows, two, members, proved)
            layers["pooled"].reshape(2, -1)[1, rows[proved]] = side
        return layers

    def _speak_for_both(
        self, pixel_counts: FloatArray, two: TwoReturns, members: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return which pixels' own photons speak for either return beside the other."""
        bank = self._fitter.bank
        every = np.broadcast_to(np.arange(bank.axis.bins), pixel_counts.shape)
        pulses = [
            (a / members)[:, None] * bank.axis.shares(bank.pulse, t, every)
            for t, a in zip(two.times_of_flight_ps, two.amplitudes, strict=True)
        ]
        dark = np.maximum(two.background / members, LEAST_BACKGROUND)[:, None]
        gained = [
            (pixel_counts * np.log1p(pulse / (dark + other)) - pulse).sum(axis=1)
            for pulse, other in (pulses, pulses[::-1])
        ]
        return np.asarray(np.minimum(*gained) > 0)


def _of_square(fit: Fit, members: NDArray[np.float64]) -> Fit:
    return replace(fit, amplitude=fit.amplitude * members, background=fit.background * members)


def _store(
    layers: Arrays,
    rows: NDArray[np.int64],
    two: TwoReturns,
    members: NDArray[np.float64],
    proved: NDArray[np.bool_],
) -> None:
    """Store proved pairs; of the others only the evidence for a second return."""
    flat = {name: values.reshape(2, -1) for name, values in layers.items()}
    flat["evidence"][1, rows] = two.evidence
    rows, members = rows[proved], members[proved]
    flat["time_of_flight_ps"][:, rows] = two.times_of_flight_ps[:, proved]
    flat["amplitude"][:, rows] = two.amplitudes[:, proved] / members
    flat["background"][:, rows] = two.background[proved] / members
    flat["sigma_ps"][:, rows] = two.sigmas_ps[:, proved]
    flat["valid"][1, rows] = True
