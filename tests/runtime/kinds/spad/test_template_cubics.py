"""Cubics between templates are the closed form, to 4 parts in 100,000 of the peak."""

import numpy as np
import pytest

from camkit.runtime.kinds.spad.bank import make_bank
from camkit.runtime.kinds.spad.pulse import GatedPulse, GaussianPulse, Pulse
from camkit.runtime.kinds.spad.template_cubics import TemplateCubics
from camkit.runtime.kinds.spad.time_axis import TimeAxis

PULSES = [GatedPulse(width_ps=200, rc_ps=60, sigma_ps=42.5), GaussianPulse(sigma_ps=31.0)]


@pytest.mark.parametrize("orientation", ["gate", "histogram"])
@pytest.mark.parametrize("pulse", PULSES, ids=["gated", "gaussian"])
def test_cubics_are_the_closed_form(orientation: str, pulse: Pulse) -> None:
    edges = np.cumsum(np.random.default_rng(0).uniform(15, 25, 126))
    axis = TimeAxis(orientation=orientation, edges_ps=edges)  # type: ignore[arg-type]
    bank = make_bank(axis, pulse)
    mu = np.random.default_rng(1).uniform(bank.mu_ps[0], bank.mu_ps[-1], 400)
    mu[:2] = bank.mu_ps[[0, -1]]
    every = np.broadcast_to(np.arange(axis.bins), (400, axis.bins))
    shares, slopes = TemplateCubics(bank).shapes(mu)
    exact = axis.shares(pulse, mu, every)
    np.testing.assert_allclose(shares, exact, atol=4e-5 * exact.max())
    steep = axis.slopes(pulse, mu, every)
    np.testing.assert_allclose(slopes, steep, atol=1e-3 * np.abs(steep).max())
