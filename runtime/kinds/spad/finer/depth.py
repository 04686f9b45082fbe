"""Depth on the fine grid: the photons of every bin made finer, then the times fitted.

    counts -- hot pixels painted over -- linear estimate of every bin -- / share -- fit -- * share

An estimate of weights w has the variance of counts times sum(w^2), so divided by that sum it has
the mean and the variance of Poisson counts again, and sigma needs no other formula. But no photon
may count for more than one, or chance is taken for a surface where they are few: the share is
max(sum(w^2), largest w), and sigma is made smaller by the root of what that is too much. Amplitudes
are multiplied back. What the estimate misses between its pixels shifts times where depth falls off:
sigma takes a part of the local slope.

Smearing times over a depth edge is worse than noise, so the estimate is that of a picture with
more photons than a bin has. From some light on a network makes bins finer still; what it does to
noise is no sum of squares, so its sigma was measured: a part of the linear one, of the slope, and
of a bin. All constants were chosen on procedural scenes.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.runtime.kinds.spad.finer.camera import FineCamera, white_of
from camkit.runtime.kinds.spad.hot_pixels import painted_over
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.sharpen import Sharpened, Sharpener, Way
from camkit.runtime.kinds.spad.time_axis import TimeAxis

SHARPER: Final = 20.0
"""Times the photons of a bin at which the estimate is taken."""
SLOPE_SHARE: Final = 0.25
"""Sub-pixels of slope that sigma takes in."""
BY_NETWORK: Final = (0.525, 0.1, 0.035)
"""Behind a network: of the linear sigma, of the slope, of a bin."""
FAINT: Final = 15.0
"""Signal photons of a pixel at which the first of them is twice as large."""
PER_PIXEL: Final = ("amplitude", "background", "intensity")
"""What is photons, and so is multiplied back."""


def bright_bin(frames: FloatArray) -> float:
    """Give the photons of a pixel in a bin where photons are, of (bins, h, w)."""
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
        """Make the bank; errors as of `Sharpener`.

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

    def cube(
        self,
        counts: FloatArray,
        dark: NDArray[np.floating],
        *,
        hot: NDArray[np.bool_],
        blind: NDArray[np.bool_],
    ) -> FineDepth:
        """Fit every sub-pixel.

        Args:
            counts: (h, w, bins).
            dark: (h, w) dark counts of a bin.
            hot: (h, w) pixels that are known to be hot; others are found.
            blind: (h, w) pixels that pile-up left no counts in some bins.
        """
        coarse = self._coarse.strip(counts, hot=hot)
        is_hot, photons = coarse.hot[0], float(coarse.amplitude[0].mean())
        sound = painted_over(counts, is_hot) if is_hot.any() else counts
        frames = np.ascontiguousarray(sound.transpose(2, 0, 1)) - dark.astype(np.float32)
        enough = self._always or photons >= self.camera.stage.network_from_photons
        size = self._size if enough else None
        estimate = self.camera.linear(SHARPER * bright_bin(frames))
        fine = estimate(frames) if size is None else self._by_network(frames, size, dark)
        gain = estimate.noise_gain.astype(np.float64) ** 2
        share = np.maximum(gain, estimate.largest)
        everywhere = np.tile(share, counts.shape[:2])
        even = np.ascontiguousarray((fine / everywhere).transpose(1, 2, 0), dtype=np.float32)
        found = self.sharpener.strip(even)
        less = np.tile(np.sqrt(gain / share), counts.shape[:2])
        found = self._told(found, everywhere, is_hot, is_hot | blind)
        linear_ps = found.sigma_ps * less
        sigma_ps = (
            self._sigma(linear_ps, found.time_of_flight_ps)
            if size is None
            else self._sigma_by_network(linear_ps, found.time_of_flight_ps, photons)
        )
        return FineDepth(found=replace(found, sigma_ps=sigma_ps), size=size, photons=photons)

    def _by_network(self, frames: FloatArray, size: str, dark: NDArray[np.floating]) -> FloatArray:
        return self.camera.by_network(frames, size, white=white_of(frames), dark=np.asarray(dark))

    @staticmethod
    def _sigma(
        linear_ps: NDArray[np.float64], times_ps: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return np.asarray(np.hypot(linear_ps, SLOPE_SHARE * _slopes(times_ps)))

    def _sigma_by_network(
        self, linear_ps: NDArray[np.float64], times_ps: NDArray[np.float64], photons: float
    ) -> NDArray[np.float64]:
        slope = _slopes(times_ps)
        of_linear, of_slope, of_bin = BY_NETWORK
        of_linear *= 1 + FAINT / max(photons, 1.0)
        least = of_bin * self.sharpener.fitter.bank.axis.step_ps
        return np.asarray(np.hypot(np.hypot(of_linear * linear_ps, of_slope * slope), least))

    def _told(
        self,
        found: Sharpened,
        share: NDArray[np.float64],
        hot: NDArray[np.bool_],
        doubtful: NDArray[np.bool_],
    ) -> Sharpened:
        scale = self.camera.scale
        valid = found.valid & ~_finer(doubtful, scale)
        changed: dict[str, Any] = {name: getattr(found, name) * share for name in PER_PIXEL}
        return replace(
            found,
            **changed,
            valid=valid,
            pooled=np.where(valid, found.pooled, 0),
            hot=np.broadcast_to(_finer(hot, scale), valid.shape).copy(),
        )


def _finer(flags: NDArray[np.bool_], scale: int) -> NDArray[np.bool_]:
    return flags.repeat(scale, axis=0).repeat(scale, axis=1)


def _slopes(times_ps: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([_slope(times) for times in times_ps])


def _slope(times_ps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give how much times change from one sub-pixel to the next, over four."""
    wide = np.pad(times_ps, 2, mode="edge")
    down = (wide[4:, 2:-2] - wide[:-4, 2:-2]) / 4
    right = (wide[2:-2, 4:] - wide[2:-2, :-4]) / 4
    return np.asarray(np.hypot(down, right))
