"""Time of flight, amplitude and background of every pixel: the log-matched bank in passes.

    counts -> coarse bank at one ratio -> background from bins away from the pulse
           -> bank at the nearest of some ratios, again where the ratio has changed
           -> parabola through the best three -> time, evidence, sigma

One ratio for all pixels fails below a signal-to-background ratio of 1; a ratio of its own for each
pixel, kept to `RATIOS`, reaches the Cramer-Rao bound.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.bank import Bank, Scorer
from camkit.runtime.kinds.spad.bound import information
from camkit.runtime.kinds.spad.evidence import search_length

RATIOS: Final = (0.0005, 0.002, 0.008, 0.03, 0.12, 0.5, 2.0, 8.0)
"""Background of a bin over signal photons, a factor of 4 apart."""
FIRST_RATIO: Final = 0.03
FIRST_EVERY: Final = 3
MOST_PASSES: Final = 3
MOST_AT_ONCE: Final = 4096
BLOCK_BYTES: Final = 48_000_000
"""What pixels that are fitted at once may need in between."""
DOUBTFUL: Final = 60.0
"""Evidence below which it is asked again at the pixel's own ratio: the table's gives too little."""
LEAST_RATE: Final = 1e-6
LEAST_SIGNAL: Final = 0.1
"""Photons: fewer are no signal to divide by."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The fits of some pixels; all arrays (p,).

    Attributes:
        time_of_flight_ps: mu.
        amplitude: Signal photons.
        background: Counts of a bin.
        sigma_ps: Standard deviation that mu should have, by the Cramer-Rao bound.
        evidence: Twice the log likelihood over that of background alone.
        template: Index of the nearest one.
    """

    time_of_flight_ps: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    background: NDArray[np.float64]
    sigma_ps: NDArray[np.float64]
    evidence: NDArray[np.float64]
    template: NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Parts:
    """Near bins of the templates, (m,) each.

    Attributes:
        share_in: Of a template, within them.
        share_out: Elsewhere.
        det: Of the two equations for signal and background.
        has_outside: Whether there are other bins.
    """

    share_in: NDArray[np.float64]
    share_out: NDArray[np.float64]
    det: NDArray[np.float64]
    has_outside: NDArray[np.bool_]


class Fitter:
    """A bank with what passes over counts need of it, made when first needed."""

    def __init__(self, bank: Bank) -> None:
        self.bank = bank
        self._scorers: dict[int, Scorer] = {}

    @cached_property
    def search_length(self) -> float:
        """Return how much there is to search, see `camkit.runtime.kinds.spad.evidence`."""
        return search_length(self.bank)

    @cached_property
    def _first(self) -> Scorer:
        return Scorer(self.bank, FIRST_RATIO, FIRST_EVERY)

    @cached_property
    def _information(self) -> NDArray[np.float64]:
        """Information J of every ratio, (ratios, m)."""
        return np.stack([information(self.bank, ratio) for ratio in RATIOS])

    @cached_property
    def _parts(self) -> "_Parts":
        """Shares of each template in its near bins and away from them."""
        bank, rows = self.bank, np.arange(len(self.bank.shares))
        first, end = bank.near.T
        padded = np.pad(np.cumsum(bank.shares, axis=1), ((0, 0), (1, 0)))
        from_left, to_right = (
            np.clip(place - bank.bins[:, 0], 0, bank.bins.shape[1]) for place in (first, end)
        )
        share_in = padded[rows, to_right] - padded[rows, from_left]
        share_out = bank.totals - share_in
        bins_in = end - first
        bins_out = bank.axis.bins - bins_in
        return _Parts(
            share_in=share_in,
            share_out=share_out,
            det=bins_out * share_in - bins_in * share_out,
            has_outside=bins_out > 0,
        )

    def _scorer(self, index: int) -> Scorer:
        if index not in self._scorers:
            self._scorers[index] = Scorer(self.bank, RATIOS[index])
        return self._scorers[index]

    def fit(self, counts: FloatArray) -> Fit:
        """Fit one return to every pixel.

        Args:
            counts: (p, bins) float32, finite and >= 0.

        Returns:
            What was found; of a pixel without photons evidence and amplitude are 0.
        """
        return in_blocks(self._fit_block, counts, self.bank)

    def _fit_block(self, counts: FloatArray) -> Fit:
        sums = summed_from_left(counts)
        photons = sums[:, -1].astype(np.float32)
        template = self._first.score(counts, photons).argmax(axis=1) * FIRST_EVERY
        amplitude, background = self.split(sums, template)
        shift, best = np.zeros(len(counts)), np.zeros(len(counts))
        scored = np.full(len(counts), -1)
        for _ in range(MOST_PASSES):
            nearest = _nearest_ratio(amplitude, background)
            for index in np.unique(nearest[nearest != scored]):
                check_wish()
                rows = np.flatnonzero((nearest == index) & (scored != index))
                scores = self._scorer(int(index)).score(counts[rows], photons[rows])
                template[rows], shift[rows], best[rows] = peak(scores)
            if (nearest == scored).all():
                break
            scored = nearest
            amplitude, background = self.split(sums, template)
        evidence = 2 * (best + photons * np.log(self.bank.axis.bins))
        doubtful = np.flatnonzero(evidence < DOUBTFUL)
        doubtful_fit = (template[doubtful], amplitude[doubtful], background[doubtful])
        exact = evidence_at(self.bank, counts[doubtful], *doubtful_fit)
        evidence[doubtful] = np.maximum(evidence[doubtful], exact)
        return Fit(
            time_of_flight_ps=self.bank.mu_ps[template] + shift * self.bank.step_ps,
            amplitude=amplitude,
            background=background,
            sigma_ps=self._sigma(amplitude, background, template),
            evidence=np.maximum(evidence, 0.0),
            template=template,
        )

    def split(
        self, sums: NDArray[np.float64], template: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Divide photons among signal and background, by those near the pulse and away from it.

        What a template puts outside its near bins is signal there too.

        Args:
            sums: (p, bins + 1) counts before each bin, see `summed_from_left`.
            template: (p,) the template of every pixel.

        Returns:
            Signal photons and counts of a bin, (p,) each.
        """
        bank, rows, parts = self.bank, np.arange(len(sums)), self._parts
        first, end = bank.near.T
        inside = sums[rows, end.take(template)] - sums[rows, first.take(template)]
        whole = sums[:, -1]
        solved = (whole - inside) * parts.share_in.take(template)
        solved -= inside * parts.share_out.take(template)
        is_solvable = parts.has_outside & (parts.det > 0)
        solved /= np.where(is_solvable, parts.det, 1.0).take(template)
        background = np.where(is_solvable.take(template), np.maximum(solved, 0.0), 0.0)
        signal = whole - background * bank.axis.bins
        signal /= np.maximum(bank.totals, 1e-6).take(template)
        return np.maximum(signal, 0.0), background

    def _sigma(
        self,
        amplitude: NDArray[np.float64],
        background: NDArray[np.float64],
        template: NDArray[np.int64],
    ) -> NDArray[np.float64]:
        """Return the bound, between the ratios of the table by the logarithm of the ratio."""
        ratio = _log_ratio(amplitude, background)
        log_ratios = np.log(np.array(RATIOS))
        place = np.interp(ratio, log_ratios, np.arange(len(log_ratios), dtype=np.float64))
        low = np.minimum(place.astype(np.int64), len(log_ratios) - 2)
        part = place - low
        table = np.log(self._information + 1e-30)
        logs = table[low, template] * (1 - part) + table[low + 1, template] * part
        # beyond the table background rules, and information falls as 1 / ratio
        excess = np.maximum(ratio - log_ratios[-1], 0.0)
        bound = np.exp(-0.5 * (logs - excess)) / np.sqrt(np.maximum(amplitude, LEAST_SIGNAL))
        return np.asarray(np.hypot(bound, self.bank.resolved_ps / np.sqrt(12)))


def evidence_at(
    bank: Bank,
    counts: FloatArray,
    template: NDArray[np.int64],
    amplitude: NDArray[np.float64],
    background: NDArray[np.float64],
    *,
    least: NDArray[np.float64] | float = LEAST_RATE,
) -> NDArray[np.float64]:
    """Return twice the log likelihood over background alone, at what was found of some pixels.

    Args:
        bank: The templates.
        counts: (p, bins).
        template: (p,) the template of every pixel.
        amplitude: (p,) signal photons.
        background: (p,) counts of a bin.
        least: (p,) or for all, that background alone is known to give.
    """
    s = bank.shares[template]
    near = np.where(s > 0, np.take_along_axis(counts, bank.bins[template], axis=1), 0.0)
    photons = counts.sum(axis=1, dtype=np.float64)
    dark = np.maximum(np.maximum(background, least), LEAST_RATE)
    even = np.maximum(np.maximum(photons / bank.axis.bins, least), LEAST_RATE)
    photons = np.maximum(photons, least * bank.axis.bins)
    gained = (near * np.log1p(amplitude[:, None] * s / dark[:, None])).sum(axis=1)
    gained += photons * np.log(dark / even)
    gained -= amplitude * s.sum(axis=1) + (dark - even) * bank.axis.bins
    return np.asarray(np.maximum(2 * gained, 0.0))


def in_blocks(fit: Callable[[FloatArray], Fit], counts: FloatArray, bank: Bank) -> Fit:
    """Fit some pixels after the other, so that little memory is needed in between."""
    of_pixel = 16 * bank.axis.bins + 12 * len(bank.mu_ps)
    size = max(1, min(MOST_AT_ONCE, BLOCK_BYTES // of_pixel))
    parts = []
    for start in range(0, max(len(counts), 1), size):
        check_wish()
        parts.append(fit(counts[start : start + size]))
    return joined(parts)


def joined(parts: Sequence[Fit]) -> Fit:
    """Return the fits of several lots of pixels as one."""
    if len(parts) == 1:
        return parts[0]
    names = [field.name for field in fields(Fit)]
    return Fit(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})


def summed_from_left(counts: FloatArray) -> NDArray[np.float64]:
    """Return the counts before each bin, and all: (p, bins + 1)."""
    sums = np.empty((counts.shape[1] + 1, len(counts)))
    sums[0] = 0
    # bin by bin for all pixels at once: along a pixel every sum would wait for the last one
    for before, after, bin_counts in zip(sums, sums[1:], cv2.transpose(counts), strict=False):
        np.add(before, bin_counts, out=after)
    return sums.T


def _log_ratio(
    amplitude: NDArray[np.float64], background: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.asarray(np.log(background / np.maximum(amplitude, LEAST_SIGNAL) + 1e-9))


def _nearest_ratio(
    amplitude: NDArray[np.float64], background: NDArray[np.float64]
) -> NDArray[np.int64]:
    logs = np.log(np.array(RATIOS))
    ratio = _log_ratio(amplitude, background)
    return np.searchsorted((logs[1:] + logs[:-1]) / 2, ratio)


def peak(
    scores: FloatArray,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the best template, how far beside it the parabola has its top, and how high it is."""
    rows, most = np.arange(len(scores)), scores.shape[1]
    best = scores.argmax(axis=1)
    middle = np.clip(best, 1, most - 2)
    left, top, right = (scores[rows, middle + d].astype(np.float64) for d in (-1, 0, 1))
    bend = left - 2 * top + right
    is_inner = (best == middle) & (bend < 0)
    shift = np.where(is_inner, (left - right) / (2 * np.where(is_inner, bend, 1.0)), 0.0)
    shift = np.clip(shift, -0.5, 0.5)
    height = np.where(is_inner, top - (left - right) * shift / 4, scores[rows, best])
    return best, shift, height
