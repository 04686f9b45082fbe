"""Two surfaces in one pixel are told apart, each with its own sigma; one is not made two."""

import numpy as np
import pytest

from camkit.runtime.kinds.spad.bank import make_bank
from camkit.runtime.kinds.spad.fit import Fitter
from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from camkit.runtime.kinds.spad.two_returns import TwoFitter, TwoReturns

PIXELS = 200


def _found(axis: TimeAxis, pulse: GatedPulse, counts: np.ndarray) -> TwoReturns:
    bank = make_bank(axis, pulse)
    return TwoFitter(bank).fit(counts, Fitter(bank).fit(counts))


@pytest.mark.parametrize(("apart", "share"), [(250.0, 0.5), (400.0, 0.25), (800.0, 0.5)])
def test_two_equal_pulses_are_told_apart(  # type: ignore[no-untyped-def]
    apart: float, share: float, axis: TimeAxis, pulse: GatedPulse, draw
) -> None:
    first = np.random.default_rng(1).uniform(700, 1200, PIXELS)
    photons = 1000
    counts = draw(axis, first, photons * (1 - share), 0.5, seed=1)
    counts += draw(axis, first + apart, photons * share, 0.0, seed=2)
    found = _found(axis, pulse, counts)
    errors = found.times_of_flight_ps - np.stack([first, first + apart])
    inside = np.abs(errors) < found.sigmas_ps
    assert (found.evidence > 20).mean() > 0.99
    assert np.median(np.abs(errors)) < 15
    assert inside.mean() == pytest.approx(0.683, abs=0.09)
    expected = np.array([[photons * (1 - share)], [photons * share]])
    np.testing.assert_allclose(np.median(found.amplitudes, 1)[:, None], expected, rtol=0.06)
    assert np.median(found.background) == pytest.approx(0.5, rel=0.1)


def test_one_surface_gives_little_evidence_of_a_second(  # type: ignore[no-untyped-def]
    axis: TimeAxis, pulse: GatedPulse, draw
) -> None:
    times = np.random.default_rng(1).uniform(700, 1900, PIXELS)
    found = _found(axis, pulse, draw(axis, times, 300, 0.2, seed=3))
    assert (found.evidence > 20).mean() < 0.01


def test_empty_pixels_are_fitted_without_noise_or_failure(
    axis: TimeAxis, pulse: GatedPulse
) -> None:
    found = _found(axis, pulse, np.zeros((2, axis.bins), np.float32))
    assert np.isfinite(found.times_of_flight_ps).all()
    assert (found.evidence < 1).all()
