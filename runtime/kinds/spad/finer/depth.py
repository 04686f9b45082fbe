"""Depth on the fine grid: the photons of every bin made finer, then the times fitted.

    counts -- hot pixels painted over -- linear estimate of every bin -- / share -- fit -- * share

An estimate of weights w has the variance of counts times sum(w^2), so divided by that sum it has
the mean and the variance of Poisson counts again, and sigma needs no other formula. But no photon
may count for more than one, or chance is taken for a surface where they are few: the share is
max(sum(w^2), largest w), and sigma is made smaller by the root of what that is too much. Amplitudes
are multiplied back.

Smearing times over a depth edge is worse than noise, so the estimate is that of a picture with
more photons than a bin has. From some light on a network makes bins finer still.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from camkit.contracts import FloatArray
from camkit.runtime.cancel import current_wish
from camkit.runtime.kinds.spad.evidence import threshold_for
from camkit.runtime.kinds.spad.finer.camera import FineCamera, white_of
from camkit.runtime.kinds.spad.finer.linear import REACH
from camkit.runtime.kinds.spad.finer.sigma import OF_LINEAR, OF_NETWORK, SigmaShares, slopes
from camkit.runtime.kinds.spad.fit import evidence_at
from camkit.runtime.kinds.spad.hot_pixels import MOST_DEAD, painted_over
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.sharpen import Sharpened, Sharpener, Way, times_photons
from camkit.runtime.kinds.spad.time_axis import TimeAxis

SHARPER: Final = 20.0
"""Times the photons of a bin of the estimate (`tools.spad.depth_sigma` at 2a55aa66)."""


def _lit(coarse: Sharpened) -> float:
    """Return the signal photons of a pixel, on average over those that show a surface."""
    valid = coarse.valid[0]
    return float(coarse.amplitude[0][valid].mean()) if valid.any() else 0.0


def bright_bin(frames: FloatArray) -> float:
    """Return the photons of a pixel in a bin where photons are, of (bins, h, w)."""
    means = np.maximum(frames.mean(axis=(1, 2), dtype=np.float64), 0)
    return float((means**2).sum() / max(float(means.sum()), 1e-12))


@dataclass(frozen=True, slots=True, kw_only=True)
class FineDepth:
    """Depth on the fine grid, and how it was found.

    Attributes:
        found: Arrays of (returns, m h, m w); photons are those of a pixel of the array.
        size: Of the network that made bins finer; None for the linear estimate.
        photons: Signal photons of a pixel, on average.
    """

    found: Sharpened
    size: str | None
    photons: float


class FineSharpener:
    """A pulse on an axis behind the plate of a bundle.

    Attributes:
        camera: The array.
        sharpener: What fits the fine counts.
        sharper: Times the photons of a bin at which the linear estimate is taken.
        shares: What goes into sigma, of the linear estimate and of a network.
    """

    def __init__(
        self,
        camera: FineCamera,
        axis: TimeAxis,
        pulse: Pulse,
        way: Way,
        *,
        size: str | None = None,
        always: bool = False,
    ) -> None:
        """Compute the bank; errors as of `Sharpener`.

        Args:
            camera: The array.
            axis: Of time.
            pulse: As it is seen.
            way: How pixels are fitted.
            size: Of the network that may make bins finer; None for the linear estimate.
            always: Whether it does so however few photons there are.
        """
        self.camera = camera
        self.sharpener = Sharpener(axis, pulse, replace(way, pool="1", seek_hot=False))
        self._coarse = Sharpener(axis, pulse, replace(way, pool="1", returns=1, method="log"))
        self._size, self._always = size, always
        self.sharper = SHARPER
        self.shares: tuple[SigmaShares, SigmaShares] = (OF_LINEAR, OF_NETWORK)

    def cube(
        self,
        counts: FloatArray,
        dark: NDArray[np.floating],
        *,
        hot: NDArray[np.bool_],
        blind: NDArray[np.bool_],
        growth: NDArray[np.float64] | None = None,
    ) -> FineDepth:
        """Fit every sub-pixel.

        Args:
            counts: (h, w, bins).
            dark: (h, w) dark counts of a bin.
            hot: (h, w) pixels that are known to be hot; others are found.
            blind: (h, w) pixels that pile-up left no counts in some bins.
            growth: (h, w) variance over mean of the counts, where pile-up was taken out of them.
        """
        coarse = self._coarse.strip(counts, hot=hot, blind=blind)
        is_hot, photons = coarse.hot[0], _lit(coarse)
        lost = is_hot | blind if (is_hot | blind).mean() <= MOST_DEAD else is_hot
        sound = painted_over(counts, lost) if lost.any() else counts
        frames = np.ascontiguousarray(sound.transpose(2, 0, 1)) - dark.astype(np.float32)
        enough = self._always or photons >= self.camera.stage.network_from_photons
        size = self._size if enough else None
        estimate = self.camera.linear(self.sharper * bright_bin(frames))
        fine = estimate(frames) if size is None else self._by_network(frames, size, dark)
        # dark counts scatter too: what is fitted holds them, as evidence and sigma must
        fine += self._finer(dark).astype(np.float32)
        gain = estimate.noise_gain.astype(np.float64) ** 2
        share = np.maximum(gain, estimate.largest)
        everywhere = np.tile(share, counts.shape[:2])
        if growth is not None:
            everywhere = everywhere * self._finer(growth)
        even = np.ascontiguousarray((fine / everywhere).transpose(1, 2, 0), dtype=np.float32)
        found = self._proved(even, self.sharpener.strip(even), coarse, everywhere)
        less = np.tile(np.sqrt(gain / share), counts.shape[:2])
        found = self._told(found, everywhere, is_hot, is_hot | blind)
        sigma_ps = self.shares[size is not None].sigma_ps(
            found.sigma_ps * less,
            slopes(found.time_of_flight_ps),
            photons=photons,
            bin_ps=self.sharpener.fitter.bank.axis.step_ps,
        )
        return FineDepth(found=replace(found, sigma_ps=sigma_ps), size=size, photons=photons)

    def _by_network(self, frames: FloatArray, size: str, dark: NDArray[np.floating]) -> FloatArray:
        return self.camera.by_network(
            frames, size, white=white_of(frames), dark=np.asarray(dark), cancel=current_wish()
        )

    def _proved(
        self,
        even: FloatArray,
        found: Sharpened,
        coarse: Sharpened,
        share: NDArray[np.float64],
    ) -> Sharpened:
        """Return it with the evidence of first returns over the background of the pixels around.

        Weights below 0 can take the background of a sub-pixel away, and anything is evidence over
        nothing.

        Args:
            even: (m h, m w, bins) what was fitted.
            found: In it.
            coarse: In the array's own pixels.
            share: (m h, m w) photons of a pixel for each that was fitted.
        """
        fitter, way = self.sharpener.fitter, self.sharpener.way
        around = uniform_filter(coarse.background[0], size=2 * REACH + 1, mode="nearest")
        least = (self._finer(around) / share).reshape(-1)
        rows = np.flatnonzero(found.valid[0])
        step = fitter.bank.step_ps
        nearest = (found.time_of_flight_ps[0].reshape(-1)[rows] - fitter.bank.mu_ps[0]) / step
        proof = evidence_at(
            fitter.bank,
            even.reshape(-1, even.shape[2])[rows],
            np.clip(np.rint(nearest).astype(np.int64), 0, len(fitter.bank.mu_ps) - 1),
            found.amplitude[0].reshape(-1)[rows],
            found.background[0].reshape(-1)[rows],
            least=least[rows],
        )
        evidence, valid = found.evidence.copy(), found.valid.copy()
        own = evidence[0].reshape(-1)
        own[rows] = np.minimum(own[rows], proof)
        threshold = threshold_for(way.false_alarms, fitter.search_length)
        valid &= valid[:1] & (own.reshape(valid.shape[1:]) > threshold)
        return replace(found, evidence=evidence, valid=valid)

    def _finer(self, values: NDArray[Any]) -> NDArray[Any]:
        return _finer(values, self.camera.scale)

    def _told(
        self,
        found: Sharpened,
        share: NDArray[np.float64],
        hot: NDArray[np.bool_],
        doubtful: NDArray[np.bool_],
    ) -> Sharpened:
        scale = self.camera.scale
        valid = found.valid & ~_finer(doubtful, scale)
        return replace(
            times_photons(found, share),
            valid=valid,
            pooled=np.where(valid, found.pooled, 0),
            hot=np.broadcast_to(_finer(hot, scale), valid.shape).copy(),
        )


def _finer(values: NDArray[Any], scale: int) -> NDArray[Any]:
    return values.repeat(scale, axis=0).repeat(scale, axis=1)
