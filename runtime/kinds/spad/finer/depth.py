"""Depth on the fine grid: times fitted to bins that were made finer.

    bins -- / share -- fit -- * share

An estimate of weights w has the variance of counts times sum(w^2), so divided by that sum it has
the mean and the variance of Poisson counts again, and sigma needs no other formula. But no photon
may count for more than one, or chance is taken for a surface where they are few: the share is
max(sum(w^2), largest w), and sigma is made smaller by the root of what that is too much. Amplitudes
are multiplied back.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from camkit.arrays import FloatArray
from camkit.runtime.kinds.spad.evidence import threshold_for
from camkit.runtime.kinds.spad.finer.bins import SHARPER, FineBins, finer_bins
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.linear import REACH
from camkit.runtime.kinds.spad.finer.sigma import OF_LINEAR, OF_NETWORK, SigmaShares, slopes
from camkit.runtime.kinds.spad.fit import evidence_at
from camkit.runtime.kinds.spad.pixels import Pixels
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.sharpen import Sharpened, Sharpener, Way, times_photons
from camkit.runtime.kinds.spad.time_axis import TimeAxis


@dataclass(frozen=True, slots=True, kw_only=True)
class FineDepth:
    """Depth on the fine grid, and how it was found.

    Attributes:
        sharpened: Arrays of (returns, m h, m w); photons are those of a pixel of the array.
        size: Of the network that made bins finer; None for the linear estimate.
        photons: Signal photons of a pixel, on average.
    """

    sharpened: Sharpened
    size: str | None
    photons: float


def coarse_sharpener(axis: TimeAxis, pulse: Pulse, way: Way) -> Sharpener:
    """Return what fits the array's own pixels before anything is made finer."""
    return Sharpener(axis, pulse, replace(way, pool="1", returns=1, method="log"))


def fine_sharpener(axis: TimeAxis, pulse: Pulse, way: Way) -> Sharpener:
    """Return what fits bins that were made finer."""
    return Sharpener(axis, pulse, replace(way, pool="1", seek_hot=False))


class FineSharpener:
    """A pulse on an axis behind the plate of a bundle, from counts to depth.

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
        self.sharpener = fine_sharpener(axis, pulse, way)
        self._coarse = coarse_sharpener(axis, pulse, way)
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
        pixels = Pixels.unknown(counts.shape[:2], hot=hot, dark=np.asarray(dark, np.float64))
        bins = finer_bins(
            self.camera,
            self._coarse,
            counts,
            replace(pixels, blind=blind),
            size=self._size,
            always=self._always,
            growth=growth,
            sharper=self.sharper,
        )
        sharpened = fitted_bins(bins.fine, bins, self.sharpener, self.shares)
        return FineDepth(sharpened=sharpened, size=bins.size, photons=bins.photons)


def fitted_bins(
    fine: FloatArray,
    bins: FineBins,
    sharpener: Sharpener,
    shares: tuple[SigmaShares, SigmaShares] = (OF_LINEAR, OF_NETWORK),
) -> Sharpened:
    """Fit every sub-pixel.

    Args:
        fine: (bins, m h, m w) photons without dark counts; changed.
        bins: How they were made finer.
        sharpener: See `fine_sharpener`.
        shares: What goes into sigma, of the linear estimate and of a network.
    """
    scale, shape = bins.scale, bins.hot.shape
    # dark counts scatter too: what is fitted holds them, as evidence and sigma must
    fine += _finer(bins.pixels.dark, scale).astype(np.float32)
    share = np.maximum(bins.gain, bins.largest)
    everywhere = np.tile(share, shape)
    if bins.growth is not None:
        everywhere = everywhere * _finer(bins.growth, scale)
    even = np.ascontiguousarray((fine / everywhere).transpose(1, 2, 0), dtype=np.float32)
    sharpened = _proved(even, sharpener, bins, everywhere)
    less = np.tile(np.sqrt(bins.gain / share), shape)
    sharpened = _in_pixels(sharpened, everywhere, bins)
    sigma_ps = shares[bins.size is not None].sigma_ps(
        sharpened.sigma_ps * less,
        slopes(sharpened.time_of_flight_ps),
        photons=bins.photons,
        bin_ps=sharpener.fitter.bank.axis.step_ps,
    )
    return replace(sharpened, sigma_ps=sigma_ps)


def _proved(
    even: FloatArray, sharpener: Sharpener, bins: FineBins, share: NDArray[np.float64]
) -> Sharpened:
    """Fit sub-pixels, with the evidence of first returns over the background of pixels around.

    Weights below 0 can take the background of a sub-pixel away, and anything is evidence over
    nothing.

    Args:
        even: (m h, m w, bins) what is fitted.
        sharpener: Fits it.
        bins: Background of the array's own pixels.
        share: (m h, m w) photons of a pixel for each that is fitted.
    """
    sharpened, fitter, way = sharpener.strip(even), sharpener.fitter, sharpener.way
    background = uniform_filter(bins.background, size=2 * REACH + 1, mode="nearest")
    least = (_finer(background, bins.scale) / share).reshape(-1)
    rows = np.flatnonzero(sharpened.valid[0])
    step = fitter.bank.step_ps
    nearest = (sharpened.time_of_flight_ps[0].reshape(-1)[rows] - fitter.bank.mu_ps[0]) / step
    proof = evidence_at(
        fitter.bank,
        even.reshape(-1, even.shape[2])[rows],
        np.clip(np.rint(nearest).astype(np.int64), 0, len(fitter.bank.mu_ps) - 1),
        sharpened.amplitude[0].reshape(-1)[rows],
        sharpened.background[0].reshape(-1)[rows],
        least=least[rows],
    )
    evidence, valid = sharpened.evidence.copy(), sharpened.valid.copy()
    first_evidence = evidence[0].reshape(-1)
    first_evidence[rows] = np.minimum(first_evidence[rows], proof)
    threshold = threshold_for(way.false_alarms, fitter.search_length)
    valid &= valid[:1] & (first_evidence.reshape(valid.shape[1:]) > threshold)
    return replace(sharpened, evidence=evidence, valid=valid)


def _in_pixels(sharpened: Sharpened, share: NDArray[np.float64], bins: FineBins) -> Sharpened:
    """Return it in photons of a pixel, without belief in what is hot or blind."""
    valid = sharpened.valid & ~_finer(bins.hot | bins.pixels.blind, bins.scale)
    return replace(
        times_photons(sharpened, share),
        valid=valid,
        pooled=np.where(valid, sharpened.pooled, 0),
        hot=np.broadcast_to(_finer(bins.hot, bins.scale), valid.shape).copy(),
    )


def _finer(values: NDArray[Any], scale: int) -> NDArray[Any]:
    return values.repeat(scale, axis=0).repeat(scale, axis=1)
