"""Photons drawn behind the prototype's gate: 125 delays of 20 ps, 200 ps wide, edges of 60 ps."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.spad.bank import Bank, make_bank
from camkit.runtime.kinds.spad.bound import information
from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from camkit.runtime.kinds.spad.twin.working import GATE_WIDTH_PS, STEP_PS

AXIS: Final = TimeAxis.regular("gate", bins=125, time_bin_ps=STEP_PS)
PULSE: Final = GatedPulse(width_ps=GATE_WIDTH_PS, rc_ps=60, sigma_ps=42.5)
DARKEST: Final = 1e-6
BLOCK: Final = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """Brightness of a scene.

    Attributes:
        photons: Signal photons of a pixel.
        sbr: Signal photons over background photons of all bins; infinite without background.
    """

    photons: float
    sbr: float

    @property
    def background(self) -> float:
        """Return the background counts of a bin."""
        return self.photons / self.sbr / AXIS.bins


def draw(
    times_ps: NDArray[np.float64], light: Light, rng: np.random.Generator, *, empty: bool = False
) -> FloatArray:
    """Draw Poisson counts (p, bins) of pixels at times of flight; `empty` has background alone."""
    counts = np.empty((len(times_ps), AXIS.bins), np.float32)
    for start in range(0, len(times_ps), BLOCK):
        times = times_ps[start : start + BLOCK]
        every = np.broadcast_to(np.arange(AXIS.bins), (len(times), AXIS.bins))
        signal = 0.0 if empty else light.photons * AXIS.shares(PULSE, times, every)
        counts[start : start + BLOCK] = rng.poisson(signal + light.background, every.shape)
    return counts


def bound_ps(times_ps: NDArray[np.float64], light: Light) -> NDArray[np.float64]:
    """Return the Cramer-Rao bound of every time, amplitude and background unknown as well."""
    bank: Bank = make_bank(AXIS, PULSE)
    of_template = information(bank, max(light.background / light.photons, DARKEST))
    fisher_information = np.interp(times_ps, bank.mu_ps, of_template)
    return np.asarray(1 / np.sqrt(light.photons * fisher_information))
