"""The photons of every time bin made finer, and what a fit of times needs to know of it.

    counts -- fitted in the array's own pixels: hot ones, light, background
           -- hot pixels painted over -- linear estimate of every bin, or a network

Smearing times over a depth edge is worse than noise, so the estimate is that of a picture with
more photons than a bin has. From some light on a network makes bins finer still.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.cancel import current_wish
from camkit.runtime.kinds.spad.finer.camera import FineCamera, white_of
from camkit.runtime.kinds.spad.hot_pixels import MOST_DEAD, painted_over
from camkit.runtime.kinds.spad.pixels import Pixels
from camkit.runtime.kinds.spad.sharpen import Sharpened, Sharpener

SHARPER: Final = 20.0
"""Times the photons of a bin of the estimate (`tools.spad.depth_sigma` at 2a55aa66)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FineBins:
    """Bins on the fine grid; all else of the array's own pixels.

    Attributes:
        fine: (bins, m h, m w) photons without dark counts.
        scale: m.
        size: Of the network that made them; None for the linear estimate.
        photons: Signal photons of a pixel, on average.
        gain: (m, m) variance of a sub-pixel over that of counts, by the linear estimate.
        largest: (m, m) how much of a sub-pixel one photon makes at most.
        pixels: Dark counts and blind pixels.
        hot: (h, w) pixels that count without light, stated or found.
        background: (h, w) counts of a bin.
        growth: (h, w) variance over mean of the counts, where pile-up was taken out of them.
    """

    fine: FloatArray
    scale: int
    size: str | None
    photons: float
    gain: NDArray[np.float64]
    largest: FloatArray
    pixels: Pixels
    hot: NDArray[np.bool_]
    background: NDArray[np.float64]
    growth: NDArray[np.float64] | None


def finer_bins(
    camera: FineCamera,
    coarse: Sharpener,
    counts: FloatArray,
    pixels: Pixels,
    *,
    size: str | None,
    always: bool,
    growth: NDArray[np.float64] | None = None,
    sharper: float = SHARPER,
) -> FineBins:
    """Make the bins of a capture finer.

    Args:
        camera: The array.
        coarse: Fits the array's own pixels.
        counts: (h, w, bins).
        pixels: What is known of them.
        size: Of the network that may make bins finer; None for the linear estimate.
        always: Whether it does so however few photons there are.
        growth: See `FineBins`.
        sharper: Times the photons of a bin at which the linear estimate is taken.
    """
    coarse_fit = coarse.strip(counts, hot=pixels.hot, blind=pixels.blind)
    hot, blind, photons = coarse_fit.hot[0], pixels.blind, _lit(coarse_fit)
    unusable = hot | blind if (hot | blind).mean() <= MOST_DEAD else hot
    sound = painted_over(counts, unusable) if unusable.any() else counts
    dark = pixels.dark
    frames = np.ascontiguousarray(sound.transpose(2, 0, 1)) - dark.astype(np.float32)
    if not (always or photons >= camera.stage.network_from_photons):
        size = None
    estimate = camera.linear(sharper * bright_bin(frames))
    fine = (
        estimate(frames)
        if size is None
        else camera.by_network(
            frames, size, white=white_of(frames), dark=dark, cancel=current_wish()
        )
    )
    return FineBins(
        fine=fine,
        scale=camera.scale,
        size=size,
        photons=photons,
        gain=estimate.noise_gain.astype(np.float64) ** 2,
        largest=estimate.largest,
        pixels=pixels,
        hot=hot,
        background=coarse_fit.background[0],
        growth=growth,
    )


def _lit(coarse: Sharpened) -> float:
    """Return the signal photons of a pixel, on average over those that show a surface."""
    valid = coarse.valid[0]
    return float(coarse.amplitude[0][valid].mean()) if valid.any() else 0.0


def bright_bin(frames: FloatArray) -> float:
    """Return the photons of a pixel in a bin where photons are, of (bins, h, w)."""
    means = np.maximum(frames.mean(axis=(1, 2), dtype=np.float64), 0)
    return float((means**2).sum() / max(float(means.sum()), 1e-12))
