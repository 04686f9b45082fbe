"""From which evidence on a return is believed, for a stated rate of false alarms.

Evidence is twice the log likelihood over background alone, the best of all times of flight. Without
any return it is the top of a squared Gaussian process that may only rise; its chance to exceed T is

    P(z > sqrt(T)) + V / (2 pi) exp(-T / 2),

V the length of the way that the normed templates take (their angles summed): the number of
independent places to search, times about 2 pi.

References: R. B. Davies, "Hypothesis testing when a nuisance parameter is present only under the
alternative", Biometrika 74 (1987).
"""

from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.bank import Bank

_MOST: Final = 200.0


def search_length(bank: Bank) -> float:
    """Return V of a bank, in radians: how far its templates, without their means, turn in all."""
    bins, s = bank.axis.bins, bank.shares
    mean = s.sum(axis=1) / bins
    norm = np.sqrt(np.maximum((s * s).sum(axis=1) - bins * mean * mean, 1e-300))
    width = s.shape[1]
    offsets = np.diff(bank.bins[:, 0]).tolist()
    products = [
        before[offset:] @ after[: width - offset] if offset < width else 0.0
        for before, after, offset in zip(s, s[1:], offsets, strict=False)
    ]
    cosine = (products - bins * mean[:-1] * mean[1:]) / (norm[:-1] * norm[1:])
    return float(sum(np.arccos(np.clip(cosine, -1.0, 1.0)).tolist()))


def false_alarm_rate(threshold: float, length: float) -> float:
    """Return the chance that background alone exceeds a threshold somewhere."""
    return float(ndtr(-np.sqrt(threshold)) + length / (2 * np.pi) * np.exp(-threshold / 2))


def threshold_for(rate: float, length: float) -> float:
    """Return the evidence that background alone exceeds at a rate.

    Args:
        rate: Of false alarms per pixel, in 0..0.5, both left out.
        length: V, see `search_length`.

    Raises:
        ContractError: If the rate is outside.
    """
    if not 0 < rate < 0.5:
        raise ContractError(f"a rate of false alarms must lie in 0..0.5; got {rate}")
    if false_alarm_rate(0.0, length) <= rate:
        return 0.0
    return float(brentq(lambda t: false_alarm_rate(t, length) - rate, 0.0, _MOST))
