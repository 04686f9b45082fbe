"""A pulse whose photons come out late, after an exponential time: what each bin sees of it.

With F the distribution of the pulse and T its part that is still to come out, photons are seen with

    distribution F(u) - T(u),   density T(u) / tau,   tau T' + T = tau F'.

For a Gaussian T is `pending`; for a measured pulse of straight lines it is exact from sample to
sample: between two of them the density is f - m tau + (g - f + m tau) exp(-dt / tau), m the slope.

A laser that fires every `period_ps` excites what has not faded yet: photons of all earlier pulses
lie beneath, T(u + period) / (1 - exp(-period / tau)).

References: E. Grushka, "Characterization of exponentially modified Gaussian peaks in
chromatography", Anal. Chem. 44 (1972).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.kinds.spad.pulse import GatedPulse, GaussianPulse, Pulse, SampledPulse, pending
from camkit.runtime.kinds.spad.time_axis import TimeAxis

Floats = NDArray[np.float64]
NUDGE: Final = 1e-3
"""Of the lifetime: step of slopes that have no closed form."""
SLACK: Final = 0.02
"""Of the axis: so much longer than a period it may be, for both are rounded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shapes:
    """The shares of a decay in bins, (p, bins) each.

    Attributes:
        shares: Of its photons.
        by_time: Their derivative by the time of the pulse, 1/ps.
        by_log: Their derivative by the logarithm of the lifetime.
    """

    shares: Floats
    by_time: Floats
    by_log: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """A pulse over a histogram, before a decay whose lifetime is to be found.

    Attributes:
        axis: Of the histogram.
        pulse: What would be seen of light that does not fade.
        period_ps: Between two pulses of the laser; None where no earlier one is seen.
    """

    axis: TimeAxis
    pulse: Pulse
    period_ps: float | None = None

    def __post_init__(self) -> None:
        if self.axis.orientation != "histogram" or isinstance(self.pulse, GatedPulse):
            raise UnsupportedError(
                "lifetimes are fitted to histograms of times, not to scans with a gate"
            )
        span = float(self.axis.edges_ps[-1] - self.axis.edges_ps[0])
        if self.period_ps is not None and not self.period_ps * (1 + SLACK) > span:
            raise ContractError(
                f"[lifetime] period_ps = {self.period_ps:g} is shorter than the {span:g} ps of "
                "the histogram; state from_ps and to_ps within one period"
            )

    def shapes(self, mu_ps: Floats, lifetime_ps: Floats) -> Shapes:
        """Return what bins see.

        Args:
            mu_ps: (p,) times of the pulse.
            lifetime_ps: (p,) > 0.
        """
        u, tau = self.axis.edges_ps - mu_ps[:, None], lifetime_ps[:, None]
        delayed, by_log = self._delayed(u, tau)
        out = self.pulse.cdf(u) - delayed
        if self.period_ps is not None:
            more, more_by_log = self._delayed(u + self.period_ps, tau)
            q = np.exp(-self.period_ps / tau)
            by_log = by_log + (more_by_log + more * q * self.period_ps / tau / (1 - q)) / (1 - q)
            delayed = delayed + more / (1 - q)
            out = out + self.pulse.cdf(u + self.period_ps) - more / (1 - q)
        return Shapes(
            shares=np.maximum(np.diff(out, axis=1), 0.0),
            by_time=-np.diff(delayed, axis=1) / tau,
            by_log=-np.diff(by_log, axis=1),
        )

    def _delayed(self, u: Floats, tau: Floats) -> tuple[Floats, Floats]:
        """Return T, and its derivative by the logarithm of tau."""
        if isinstance(self.pulse, GaussianPulse):
            sigma = self.pulse.sigma_ps
            delayed = pending(u, sigma, tau)
            bell = np.exp(-0.5 * (u / sigma) ** 2) / np.sqrt(2 * np.pi)
            return delayed, delayed * (u / tau - (sigma / tau) ** 2) + bell * sigma / tau
        if not isinstance(self.pulse, SampledPulse):
            raise UnsupportedError("lifetimes need a Gaussian or a measured pulse")
        high, low = (
            _delayed_of_samples(self.pulse, u, tau * factor) for factor in (1 + NUDGE, 1 - NUDGE)
        )
        return _delayed_of_samples(self.pulse, u, tau), (high - low) / (2 * NUDGE)


def _delayed_of_samples(pulse: SampledPulse, u: Floats, tau: Floats) -> Floats:
    """Return T of straight lines between samples, exactly; u (p, n), tau (p, 1)."""
    t, f = pulse.times_ps, pulse.density(pulse.times_ps)
    steps, slopes = np.diff(t), np.diff(f) / np.diff(t)
    density = np.zeros((len(tau), len(t)))
    for i, (step, slope) in enumerate(zip(steps, slopes, strict=True)):
        rest = density[:, i] - f[i] + slope * tau[:, 0]
        faded = rest * np.exp(-step / tau[:, 0])
        density[:, i + 1] = f[i + 1] - slope * tau[:, 0] + faded
    at = np.clip(np.searchsorted(t, u, side="right") - 1, 0, len(steps) - 1)
    start_density = np.take_along_axis(density, at, axis=1)
    offset = np.clip(u - t[at], 0.0, None)
    inside = np.minimum(offset, steps[at])
    rest = (start_density - f[at] + slopes[at] * tau) * np.exp(-inside / tau)
    delayed = f[at] + slopes[at] * inside - slopes[at] * tau + rest
    delayed = delayed * np.exp(-(offset - inside) / tau)
    return np.asarray(np.where(u < t[0], 0.0, delayed * tau))
