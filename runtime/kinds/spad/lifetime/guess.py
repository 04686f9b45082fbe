"""The width of a pulse that nobody stated, from all photons together: a Gaussian and one decay."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.lifetime.decay import Decay
from camkit.runtime.kinds.spad.lifetime.fitter import LifetimeFitter
from camkit.runtime.kinds.spad.pulse import GaussianPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

NARROWEST: Final = 0.4
WIDEST: Final = 0.05
"""Standard deviations that are tried: from so much of a bin to so much of the axis."""
SIGMA_STEP: Final = 1.3
LEAST_PHOTONS: Final = 2000
MOST_PHOTONS: Final = 1e6
"""More tell of a second lifetime before they tell more of the pulse."""


def guess_width(counts: FloatArray, axis: TimeAxis, period_ps: float | None) -> GaussianPulse:
    """Estimate the width of the pulse before a decay.

    Args:
        counts: (p, bins) counts of some pixels.
        axis: Their times.
        period_ps: Of the laser; None where no earlier pulse is seen.

    Raises:
        ContractError: If they hold too few photons.
    """
    whole = counts.sum(axis=0, dtype=np.float64)[None]
    photons = float(whole.sum())
    if photons < LEAST_PHOTONS:
        raise ContractError(
            f"no pulse is stated, and {photons:.0f} photons are too few to find its width before "
            f"a decay; state [laser] fwhm_ps or [irf] file in a file for {option_text('timing')}"
        )
    whole = (whole * min(1.0, MOST_PHOTONS / photons)).astype(np.float32)
    low, high = NARROWEST * axis.step_ps, WIDEST * axis.step_ps * axis.bins
    count = max(3, int(np.log(max(high / low, SIGMA_STEP)) / np.log(SIGMA_STEP)) + 1)
    sigmas = np.geomspace(low, max(high, low * SIGMA_STEP), count)
    likely = np.array([_evidence(whole, axis, sigma, period_ps) for sigma in sigmas])
    at = int(np.clip(likely.argmax(), 1, count - 2))
    left, top, right = likely[at - 1 : at + 2]
    bend = left - 2 * top + right
    shift = np.clip((left - right) / (2 * bend), -1.0, 1.0) if bend < 0 else 0.0
    return GaussianPulse(sigma_ps=float(sigmas[at] * (sigmas[at + 1] / sigmas[at]) ** shift))


def _evidence(whole: FloatArray, axis: TimeAxis, sigma: float, period_ps: float | None) -> float:
    decay = Decay(axis=axis, pulse=GaussianPulse(sigma_ps=sigma), period_ps=period_ps)
    return float(LifetimeFitter(decay).fit(whole).evidence[0])
