"""What bins and gates see of a pulse."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.pulse import GatedPulse, GaussianPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis


def _all(axis: TimeAxis, count: int) -> np.ndarray:
    return np.broadcast_to(np.arange(axis.bins), (count, axis.bins))


@pytest.mark.parametrize("orientation", ["gate", "histogram"])
def test_a_whole_pulse_is_shared_out_to_its_bins(orientation: str, pulse: GatedPulse) -> None:
    axis = TimeAxis.regular(orientation, bins=150, time_bin_ps=20, first_ps=-500)  # type: ignore[arg-type]
    times = np.array([700.0, 903.7])
    np.testing.assert_allclose(axis.shares(pulse, times, _all(axis, 2)).sum(1), 1, atol=1e-4)


def test_a_histogram_sees_the_pulse_and_a_gate_its_mirror_image(pulse: GatedPulse) -> None:
    bins = np.arange(201)[None]
    seen = {}
    for name in ("gate", "histogram"):
        axis = TimeAxis.regular(name, bins=201, time_bin_ps=10, first_ps=-1000)  # type: ignore[arg-type]
        seen[name] = axis.shares(pulse, np.array([0.0]), bins)[0]
        assert axis.centres_ps[seen[name].argmax()] * (1 if name == "histogram" else -1) > 0
    np.testing.assert_allclose(seen["gate"][::-1], seen["histogram"], atol=2e-4)


def test_a_pulse_much_shorter_than_a_bin_loses_nothing() -> None:
    axis = TimeAxis.regular("histogram", bins=16, time_bin_ps=1000)
    times = np.array([3100.0, 3499.9, 3500.0])
    shares = axis.shares(GaussianPulse(sigma_ps=0.01), times, _all(axis, 3))
    np.testing.assert_allclose(shares.sum(1), 1, atol=1e-12)
    np.testing.assert_allclose(shares[:, 3], [1, 1, 0.5], atol=1e-9)


def test_gates_see_the_same_light_however_far_apart_they_are(pulse: GatedPulse) -> None:
    even = TimeAxis.regular("gate", bins=20, time_bin_ps=50)
    edges = even.edges_ps.copy()
    edges[-1] += 400  # the last gate is far away from the others
    uneven = TimeAxis(orientation="gate", edges_ps=edges)
    bins = np.arange(19)[None]
    one, other = (a.shares(pulse, np.array([400.0]), bins) / a.step_ps for a in (even, uneven))
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_slopes_are_differences_of_shares(pulse: GatedPulse) -> None:
    for name in ("gate", "histogram"):
        axis = TimeAxis.regular(name, bins=80, time_bin_ps=20)  # type: ignore[arg-type]
        times, h = np.array([500.0, 811.3]), 0.5
        bins = _all(axis, 2)
        expected = (axis.shares(pulse, times + h, bins) - axis.shares(pulse, times - h, bins)) / (
            2 * h
        )
        np.testing.assert_allclose(axis.slopes(pulse, times, bins), expected, atol=2e-6)


def test_axes_that_are_none_are_refused() -> None:
    with pytest.raises(ContractError, match="at least 8 bins; got 7"):
        TimeAxis.regular("gate", bins=7, time_bin_ps=1)
    with pytest.raises(ContractError, match="time_bin_ps must be > 0"):
        TimeAxis.regular("gate", bins=70, time_bin_ps=0)
    with pytest.raises(ContractError, match="gate or histogram; got 'delay'"):
        TimeAxis.regular("delay", bins=70, time_bin_ps=1)  # type: ignore[arg-type]
    for edges in (np.zeros(20), np.arange(20.0)[::-1], np.full(20, np.nan)):
        with pytest.raises(ContractError, match="finite and increase"):
            TimeAxis(orientation="gate", edges_ps=edges)
