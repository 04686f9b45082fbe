"""The distribution of one detected photon's time: density and integral of a pulse, closed form.

A pulse that left for a target at time of flight mu is seen at mu + u; u has the density and the
distribution given here. In a histogram that is what lies in a bin. A gate that opens at t sees
photons with the chance p(mu - t), where p is the density times `height_ps`.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx, ndtr

from camkit.errors import ContractError

Times = NDArray[np.float64]
_SIGMAS = 6.0
_DECAYS = 14.0
"""So many sigmas and time constants hold all but a millionth of a pulse."""
FWHM_PER_SIGMA = 2.3548
_LEAST_SIGMA_PS = 1e-3


class Pulse(Protocol):
    """Times of detection, relative to the time of flight.

    Attributes:
        start_ps: Before it nothing arrives.
        end_ps: After it nothing does.
        mean_ps: Of all photons.
        finest_ps: Standard deviation of its steepest edge.
        height_ps: Integral of what a gate sees over its delay.
    """

    @property
    def start_ps(self) -> float: ...  # noqa: D102
    @property
    def end_ps(self) -> float: ...  # noqa: D102
    @property
    def mean_ps(self) -> float: ...  # noqa: D102
    @property
    def finest_ps(self) -> float: ...  # noqa: D102
    @property
    def height_ps(self) -> float: ...  # noqa: D102

    def density(self, u_ps: Times) -> Times:
        """Return the density, 1/ps; it integrates to 1."""
        ...

    def cdf(self, u_ps: Times) -> Times:
        """Return the share of photons that came before."""
        ...


def pending(u_ps: Times, sigma_ps: float, decay_ps: float | Times) -> Times:
    """Return the share that a Gaussian has begun and an exponential decay not yet let out.

    It is the distribution of a normal less that of a normal plus an exponential; over the time
    constant it is the density of the latter.

    Args:
        u_ps: Times.
        sigma_ps: Standard deviation, > 0.
        decay_ps: Time constant, > 0.
    """
    z = (sigma_ps / decay_ps - u_ps / sigma_ps) / np.sqrt(2)
    far = z < 0  # there erfcx would overflow, and its other form does not
    near = np.exp(-0.5 * (u_ps / sigma_ps) ** 2) * erfcx(np.maximum(z, 0)) / 2
    slope = 0.5 * (sigma_ps / decay_ps) ** 2 - u_ps / decay_ps
    late = np.exp(np.where(far, slope, 0.0)) * ndtr(-np.sqrt(2) * z)
    return np.asarray(np.where(far, late, near))


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussianPulse:
    """A pulse without a gate: laser and jitter.

    Attributes:
        sigma_ps: Its standard deviation.
    """

    sigma_ps: float

    def __post_init__(self) -> None:
        if not 0 < self.sigma_ps < 1e9:
            raise ContractError(f"a pulse needs a width > 0 ps; got {self.sigma_ps}")

    @property
    def start_ps(self) -> float:
        """Return when it begins."""
        return -_SIGMAS * self.sigma_ps

    @property
    def end_ps(self) -> float:
        """Return when it ends."""
        return _SIGMAS * self.sigma_ps

    @property
    def mean_ps(self) -> float:
        """Return its centre."""
        return 0.0

    @property
    def finest_ps(self) -> float:
        """Return the standard deviation of its edges."""
        return self.sigma_ps

    @property
    def height_ps(self) -> float:
        """Return its integral where its peak is 1."""
        return self.sigma_ps * float(np.sqrt(2 * np.pi))

    def density(self, u_ps: Times) -> Times:
        """Return the density, 1/ps."""
        u = u_ps / self.sigma_ps
        return np.asarray(np.exp(-0.5 * u * u) / self.height_ps)

    def cdf(self, u_ps: Times) -> Times:
        """Return the share of photons that came before."""
        return np.asarray(ndtr(u_ps / self.sigma_ps))


@dataclass(frozen=True, slots=True, kw_only=True)
class GatedPulse:
    """A pulse seen through a gate whose edges rise and fall exponentially.

    p(u) = R(u) - R(u - width), R(u) = 1 - exp(-u / rc) for u > 0, convolved with a Gaussian.

    Attributes:
        width_ps: Of the gate.
        rc_ps: Time constant of its edges; 0 for a rectangle.
        sigma_ps: Standard deviation of the Gaussian, of jitter and laser together.
    """

    width_ps: float
    rc_ps: float
    sigma_ps: float

    def __post_init__(self) -> None:
        if not 0 < self.width_ps < 1e9:
            raise ContractError(f"a gate needs a width > 0 ps; got {self.width_ps}")
        if not 0 <= self.rc_ps < 1e9:
            raise ContractError(f"a gate's time constant must be >= 0 ps; got {self.rc_ps}")
        if not 0 <= self.sigma_ps < 1e9:
            raise ContractError(f"jitter must be >= 0 ps; got {self.sigma_ps}")

    @property
    def start_ps(self) -> float:
        """Return when it begins."""
        return -_SIGMAS * self.sigma_ps

    @property
    def end_ps(self) -> float:
        """Return when it ends."""
        return self.width_ps + _SIGMAS * self.sigma_ps + _DECAYS * self.rc_ps

    @property
    def mean_ps(self) -> float:
        """Return the mean of all times."""
        return self.width_ps / 2 + self.rc_ps

    @property
    def finest_ps(self) -> float:
        """Return the standard deviation of its edges."""
        return max(float(np.hypot(self.sigma_ps, self.rc_ps)), self.width_ps / 100)

    @property
    def height_ps(self) -> float:
        """Return the integral of p, which is the width."""
        return self.width_ps

    def density(self, u_ps: Times) -> Times:
        """Return the density, 1/ps."""
        edges = self._edge(u_ps) - self._edge(u_ps - self.width_ps)
        return np.asarray(np.maximum(edges, 0.0) / self.width_ps)

    def cdf(self, u_ps: Times) -> Times:
        """Return the share of photons that came before, by the integral of the edges."""
        ramps = self._ramp(u_ps) - self._ramp(u_ps - self.width_ps)
        return np.asarray(np.clip(ramps / self.width_ps, 0.0, 1.0))

    def _edge(self, u: Times) -> Times:
        """Return R convolved with the Gaussian: the distribution of exponential plus normal."""
        sigma = max(self.sigma_ps, _LEAST_SIGMA_PS)
        whole = np.asarray(ndtr(u / sigma))
        return whole if self.rc_ps == 0 else whole - pending(u, sigma, self.rc_ps)

    def _ramp(self, u: Times) -> Times:
        """Return the integral of `_edge`."""
        sigma = max(self.sigma_ps, _LEAST_SIGMA_PS)
        x = u / sigma
        positive = u * ndtr(x) + sigma * np.exp(-0.5 * x * x) / np.sqrt(2 * np.pi)
        return np.asarray(positive - self.rc_ps * self._edge(u))


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledPulse:
    """A pulse that was measured: straight lines between samples, 0 outside.

    Attributes:
        times_ps: (n,) increasing; mu is where they are 0.
        values: (n,) >= 0, in any unit.
    """

    times_ps: Times
    values: Times

    def __post_init__(self) -> None:
        times, values = self.times_ps, self.values
        if times.ndim != 1 or times.shape != values.shape or len(times) < 3:
            raise ContractError(
                "a measured pulse needs a value for each of at least 3 times; got times of shape "
                f"{times.shape} and values of {values.shape}"
            )
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            first = int(np.argmin(np.isfinite(times) & np.isfinite(values)))
            raise ContractError(
                f"a measured pulse must hold finite numbers; got {values[first]:g} at "
                f"{times[first]:g} ps"
            )
        if (np.diff(times) <= 0).any() or (values < 0).any() or not values.any():
            raise ContractError(
                "a measured pulse needs increasing times and values >= 0 that are not all 0; got "
                f"times with steps of {np.diff(times).min():g} ps and more, values of "
                f"{values.min():g} to {values.max():g}"
            )

    @property
    def start_ps(self) -> float:
        """Return the first time."""
        return float(self.times_ps[0])

    @property
    def end_ps(self) -> float:
        """Return the last time."""
        return float(self.times_ps[-1])

    @property
    def mean_ps(self) -> float:
        """Return the mean of all times."""
        t, v = self.times_ps, self.values
        step = np.diff(t)
        mass = (v[1:] + v[:-1]) / 2 * step
        moment = step * (t[:-1] * (2 * v[:-1] + v[1:]) + t[1:] * (v[:-1] + 2 * v[1:])) / 6
        return float(moment.sum() / mass.sum())

    @property
    def finest_ps(self) -> float:
        """Return the standard deviation of a Gaussian whose flank is as steep as the steepest."""
        slope = np.abs(np.diff(self.values) / np.diff(self.times_ps)).max()
        return float(self.values.max() / slope * np.exp(-0.5))

    @property
    def height_ps(self) -> float:
        """Return its integral where its peak is 1."""
        return float(np.trapezoid(self.values, self.times_ps) / self.values.max())

    def density(self, u_ps: Times) -> Times:
        """Return the density, 1/ps."""
        whole = np.trapezoid(self.values, self.times_ps)
        return np.asarray(np.interp(u_ps, self.times_ps, self.values, left=0, right=0) / whole)

    def cdf(self, u_ps: Times) -> Times:
        """Return the share of photons that came before, exact for straight lines."""
        t, v = self.times_ps, self.values
        sums = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * np.diff(t))])
        u = np.clip(u_ps, t[0], t[-1])
        i = np.clip(np.searchsorted(t, u, side="right") - 1, 0, len(t) - 2)
        offset = u - t[i]
        slope = (v[i + 1] - v[i]) / (t[i + 1] - t[i])
        return np.asarray((sums[i] + offset * (v[i] + slope * offset / 2)) / sums[-1])
