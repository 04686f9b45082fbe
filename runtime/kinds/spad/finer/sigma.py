"""Sigma of times on the fine grid: of noise, of what the estimate misses, of what it never gets.

    sigma^2 = (noise (1 + faint / photons) sigma_linear)^2 + (slope s)^2 + (bin w)^2

with sigma_linear that of the linear estimate, s the change of times from one sub-pixel to the next
and w the width of a bin. What an estimate misses between its pixels shifts times where depth falls
off. A network does to noise what no sum of squares tells, the more the fainter a capture is, and
has a rest of error that more photons do not take away; so its shares are fitted to errors measured
on procedural scenes (`python -m tools.spad.depth_sigma` at 2a55aa66).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SigmaShares:
    """The shares of sigma.

    Attributes:
        noise: Of the linear estimate's sigma, in bright captures.
        faint: Signal photons of a pixel at which that share is twice as large.
        slope: Sub-pixels of slope.
        of_bin: Of the width of a bin.
    """

    noise: float = 1.0
    faint: float = 0.0
    slope: float = 0.0
    of_bin: float = 0.0

    def sigma_ps(
        self,
        linear_ps: NDArray[np.float64],
        slopes_ps: NDArray[np.float64],
        *,
        photons: float,
        bin_ps: float,
    ) -> NDArray[np.float64]:
        """Return sigma.

        Args:
            linear_ps: That of the linear estimate.
            slopes_ps: `slopes` of the times.
            photons: Signal photons of a pixel, on average.
            bin_ps: Width of a bin.
        """
        noise = self.noise * (1 + self.faint / max(photons, 1.0))
        missed = np.hypot(noise * linear_ps, self.slope * slopes_ps)
        return np.asarray(np.hypot(missed, self.of_bin * bin_ps))


OF_LINEAR: Final = SigmaShares(slope=0.1)
OF_NETWORK: Final = SigmaShares(noise=0.48, faint=28.0, slope=0.155, of_bin=0.039)


def slopes(times_ps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much times (returns, h, w) change from one sub-pixel to the next, over four."""
    wide = np.pad(times_ps, ((0, 0), (2, 2), (2, 2)), mode="edge")
    down = (wide[:, 4:, 2:-2] - wide[:, :-4, 2:-2]) / 4
    right = (wide[:, 2:-2, 4:] - wide[:, 2:-2, :-4]) / 4
    return np.asarray(np.hypot(down, right))
