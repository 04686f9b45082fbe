"""Noise of a linear signal: shot noise that grows with it, and read noise that does not."""

from dataclasses import dataclass

import numpy as np

from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseModel:
    """Signal-dependent noise of a linear signal: variance = shot * signal + read_variance.

    Attributes:
        shot: Variance per unit of signal, one per channel.
        read_variance: Variance at zero signal, one per channel.
    References: Foi et al. 2008; DNG specification 1.7, NoiseProfile.
    """

    shot: tuple[float, ...]
    read_variance: tuple[float, ...]

    def __post_init__(self) -> None:
        values = np.array([*self.shot, *self.read_variance], dtype=np.float64)
        same = 0 < len(self.shot) == len(self.read_variance)
        if not same or not np.isfinite(values).all() or (values < 0).any():
            raise ContractError(
                "noise needs one finite value >= 0 of each kind for every channel; "
                f"got {self.shot}, {self.read_variance}"
            )

    def with_gains(self, gains: tuple[float, ...]) -> "NoiseModel":
        """Return the noise of the signal after multiplication by one gain per channel."""
        return NoiseModel(
            shot=tuple(s * g for s, g in zip(self.shot, gains, strict=True)),
            read_variance=tuple(v * g * g for v, g in zip(self.read_variance, gains, strict=True)),
        )

    def raised(self, factors: tuple[float, ...]) -> "NoiseModel":
        """Return the noise whose variance is multiplied by one factor per channel."""
        return NoiseModel(
            shot=tuple(s * f for s, f in zip(self.shot, factors, strict=True)),
            read_variance=tuple(v * f for v, f in zip(self.read_variance, factors, strict=True)),
        )

    def at_least(self, other: "NoiseModel") -> "NoiseModel":
        """Return the noise that is nowhere below another one of as many channels."""
        return NoiseModel(
            shot=tuple(map(max, self.shot, other.shot)),
            read_variance=tuple(map(max, self.read_variance, other.read_variance)),
        )
