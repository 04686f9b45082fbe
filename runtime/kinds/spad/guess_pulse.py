"""A pulse where none is stated: the Gaussian under which the brightest pixels are likeliest."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.bank import make_bank
from camkit.runtime.kinds.spad.fit import Fitter
from camkit.runtime.kinds.spad.pulse import GaussianPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

NARROWEST: Final = 0.5
WIDEST: Final = 0.1
"""Standard deviations that are tried: from half a bin to a tenth of the axis."""
SIGMA_STEP: Final = 1.3
PIXELS: Final = 256
LEAST_PHOTONS: Final = 200
LOOK: Final = 2.0
"""Standard deviation, in bins, by which the pixels that show a pulse are found."""


def guess_pulse(counts: FloatArray, axis: TimeAxis) -> GaussianPulse:
    """Estimate the width of the pulse.

    Args:
        counts: (p, bins) counts of some pixels.
        axis: Their times.

    Raises:
        ContractError: If they hold too few photons.
    """
    bright = counts[np.argsort(counts.sum(axis=1))[::-1][: 16 * PIXELS]]
    first_fit = _fitter(axis, LOOK * axis.step_ps).fit(bright)
    best = np.argsort(first_fit.evidence)[::-1][:PIXELS]
    brightest = bright[best]
    if first_fit.amplitude[best].sum() < LEAST_PHOTONS:
        raise ContractError(
            f"no pulse is stated, and {first_fit.amplitude[best].sum():.0f} photons are too few to "
            "find its width; state [laser] fwhm_ps, [gate] or [irf] in a file for "
            f"{option_text('timing')}"
        )
    low, high = NARROWEST * axis.step_ps, WIDEST * axis.step_ps * axis.bins
    count = max(3, int(np.log(max(high / low, SIGMA_STEP)) / np.log(SIGMA_STEP)) + 1)
    sigmas = np.geomspace(low, max(high, low * SIGMA_STEP), count)
    likely = [_fitter(axis, sigma).fit(brightest).evidence.sum() for sigma in sigmas]
    at = int(np.clip(np.argmax(likely), 1, count - 2))
    left, top, right = likely[at - 1 : at + 2]
    bend = left - 2 * top + right
    shift = np.clip((left - right) / (2 * bend), -1.0, 1.0) if bend < 0 else 0.0
    return GaussianPulse(sigma_ps=float(sigmas[at] * (sigmas[at + 1] / sigmas[at]) ** shift))


def _fitter(axis: TimeAxis, sigma_ps: float) -> Fitter:
    return Fitter(make_bank(axis, GaussianPulse(sigma_ps=sigma_ps)))
