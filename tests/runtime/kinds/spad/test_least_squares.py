"""Least squares find what a slow search finds, scatter as said, and more than the log bank."""

import numpy as np
import pytest

from camkit.runtime.kinds.spad.bank import make_bank
from camkit.runtime.kinds.spad.fit import Fitter
from camkit.runtime.kinds.spad.least_squares import LeastSquares
from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis


@pytest.fixture(scope="module")
def fitter(axis: TimeAxis, pulse: GatedPulse) -> Fitter:
    return Fitter(make_bank(axis, pulse))


def test_the_least_square_is_found(fitter: Fitter, axis: TimeAxis, draw) -> None:  # type: ignore[no-untyped-def]
    counts = draw(axis, np.full(20, 1234.0), 200, 0.5)
    found = LeastSquares(fitter).fit(counts)
    bins = np.arange(axis.bins)[None]
    tried = np.arange(1134.0, 1334.0, 0.25)
    shapes = axis.shares(fitter.bank.pulse, tried, np.broadcast_to(bins, (len(tried), axis.bins)))
    for n, mu in zip(counts, found.time_of_flight_ps, strict=True):
        left = []
        for s in shapes:
            a = np.stack([s, np.ones_like(s)], axis=1)
            left.append(np.linalg.lstsq(a, n, rcond=None)[1][0])
        assert mu == pytest.approx(tried[int(np.argmin(left))], abs=1.0)


@pytest.mark.parametrize(("photons", "even"), [(100, 0.0), (1000, 0.0), (300, 2.4)])
def test_errors_are_as_large_as_said(  # type: ignore[no-untyped-def]
    fitter: Fitter, axis: TimeAxis, draw, photons: float, even: float
) -> None:
    times = np.random.default_rng(1).uniform(700, 1700, 4000)
    counts = draw(axis, times, photons, even, seed=2)
    found = LeastSquares(fitter).fit(counts)
    errors = (found.time_of_flight_ps - times) / found.sigma_ps
    assert np.mean(np.abs(errors) < 1) == pytest.approx(0.683, abs=0.04)
    best = fitter.fit(counts)
    assert np.std(found.time_of_flight_ps - times) > np.std(best.time_of_flight_ps - times)
    # nearly one likelihood: the log bank takes the nearest of a few ratios for it
    assert np.median(found.evidence / best.evidence) == pytest.approx(1.0, abs=0.03)


def test_a_dark_pixel_has_no_evidence(fitter: Fitter, axis: TimeAxis) -> None:
    found = LeastSquares(fitter).fit(np.zeros((3, axis.bins), np.float32))
    assert not found.evidence.any()
    assert not found.amplitude.any()
