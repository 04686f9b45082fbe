"""A light that is no point: a disc, even and of known diameter, taken out of its own picture.

    picture of the disc -> a disc blurred by a Gaussian, fitted: its place and its blur
      -> what this leaves, divided by the disc's spectrum as far as noise allows, farther out as far
      as this makes no noise stronger -> back onto the Gaussian

The spectrum of a disc of diameter D has rings of zeros, from 1.22 / D cycles per pixel on. What a
PSF holds there no picture of the disc shows; the Gaussian stands in for it. How much of the core
that is, is what decides whether a disc is small enough.

References: Goodman, "Introduction to Fourier optics" (the spectrum of a disc, 2 J1(x) / x);
Wiener 1949, "Extrapolation, interpolation, and smoothing of stationary time series".
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import fft, interpolate, optimize, special

from camkit.calibration.lattice import FloatGrid, Lattice
from camkit.calibration.light import CORE_PX, REST_PX
from camkit.calibration.trim import smooth_noise
from camkit.errors import DecodeError

MOST_HIDDEN: Final = 0.02
"""Of the power of the core's spectrum, that disc and noise may hide."""
CLOSE_SPREADS: Final = 4.0
"""Of the Gaussian, as far as which noise decides what is divided."""
FAR_REGULAR: Final = 0.3
RING_STEP: Final = 0.01
RINGS: Final = 9
"""Of that many cycles per pixel, over which the power of a spectrum is taken to be even."""
FloatLine = NDArray[np.float64]
_NODES: Final = 48
_RADIUS_STEP_PX: Final = 0.1
_SPREADS_PX: Final = (0.25, 8.0)
_START_SPREAD_PX: Final = 1.2
_FAR_SPREADS: Final = 8.0
_MARGIN_PX: Final = 16
_LEAST_POWER: Final = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscCore:
    """A disc blurred by a Gaussian: its centre in pixels, its height if it were not blurred."""

    y: float
    x: float
    level: float
    diameter_px: float
    spread_px: float

    @property
    def radius_px(self) -> float:
        """Return the radius within which residuals show whether the disc fits."""
        return self.diameter_px / 2 + REST_PX

    @property
    def height(self) -> float:
        """Return its value in the middle."""
        return self.level * float(1 - np.exp(-((self.diameter_px / self.spread_px) ** 2) / 8))

    @property
    def light(self) -> float:
        """Return its sum over all pixels."""
        return self.level * np.pi * self.diameter_px**2 / 4

    def at(self, y: FloatGrid, x: FloatGrid) -> FloatGrid:
        """Return its values at pixels."""
        radius = np.hypot(y - self.y, x - self.x)
        most = self.diameter_px / 2 + _FAR_SPREADS * self.spread_px
        places = np.arange(0.0, most + _RADIUS_STEP_PX, _RADIUS_STEP_PX)
        profile = blurred_disc(places, self.diameter_px, self.spread_px)
        inside = np.where(radius < most, radius, most)
        height = interpolate.CubicSpline(places, profile)(inside)
        return np.asarray(np.where(radius < most, self.level * height, 0.0))


def blurred_disc(radius_px: FloatLine, diameter_px: float, spread_px: float) -> FloatLine:
    """Return a disc of height 1 blurred by a Gaussian of unit sum, at distances from its middle.

    The Gaussian is integrated over circles in closed form, a modified Bessel function, and over
    their radii by quadrature.
    """
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    at = (node + 1) * diameter_px / 4
    square = spread_px**2
    bell = np.exp(-((radius_px[:, None] - at) ** 2) / (2 * square))
    rings = at / square * bell * special.ive(0, radius_px[:, None] * at / square)
    return np.asarray(rings @ weight * diameter_px / 4)


def middle_of(
    cells: NDArray[np.floating], place: tuple[int, int], radius: float
) -> tuple[int, int]:
    """Return (row, column) of the middle of a disc, from any place on it.

    Args:
        cells: (h, w) light, dark around.
        place: (row, column) of its brightest cell, which lies anywhere.
        radius: Of the disc, in cells.
    """
    reach = int(np.ceil(2 * radius)) + 2
    top, left = (max(0, n - reach) for n in place)
    near = cells[top : place[0] + reach + 1, left : place[1] + reach + 1].astype(np.float64)
    y, x = np.nonzero(near > near.max() / 2)
    return top + int(np.median(y)), left + int(np.median(x))


def fit_disc(lattice: Lattice, y: float, x: float, diameter_px: float) -> DiscCore:
    """Fit a blurred disc to the samples of a colour around a place.

    Args:
        lattice: Light of a colour, background taken off.
        y: Row in pixels near the centre.
        x: Column in pixels.
        diameter_px: Of the disc, unblurred.

    Raises:
        DecodeError: If there is no light of this colour.
    """
    at_y, at_x = lattice.places()
    near = np.hypot(at_y - y, at_x - x) <= diameter_px / 2 + CORE_PX
    near &= np.isfinite(lattice.values)
    values = lattice.values[near]
    top = float(values.max(initial=0))
    if top <= 0:
        raise DecodeError("the light is dark in one colour: take one that every colour sees")
    dy, dx = at_y[near] - y, at_x[near] - x

    def disc(p: FloatLine) -> DiscCore:
        return DiscCore(
            y=float(p[0]),
            x=float(p[1]),
            level=float(p[2]),
            diameter_px=diameter_px,
            spread_px=float(np.exp(p[3])),
        )

    def misfit(p: FloatLine) -> FloatLine:
        return np.asarray(disc(p).at(dy, dx) - values / top)

    reach = CORE_PX + diameter_px / 2
    log_low, log_high = np.log(_SPREADS_PX)
    start = [0.0, 0.0, 1.0, np.log(_START_SPREAD_PX)]
    bounds = ([-reach, -reach, 0.0, log_low], [reach, reach, 100.0, log_high])
    fitted = disc(optimize.least_squares(misfit, start, bounds=bounds).x)
    return DiscCore(
        y=y + fitted.y,
        x=x + fitted.x,
        level=fitted.level * top,
        diameter_px=diameter_px,
        spread_px=fitted.spread_px,
    )


def disc_spectrum(cycles_per_px: FloatGrid, diameter_px: float) -> FloatGrid:
    """Return the spectrum of a disc of unit sum: 2 J1(pi D f) / (pi D f)."""
    at = np.pi * diameter_px * np.maximum(cycles_per_px, 1e-12)
    return np.asarray(2 * special.j1(at) / at)


def without_disc(
    image: FloatGrid,
    noise: FloatGrid,
    core: DiscCore,
    offset_px: tuple[float, float],
    pitch_px: float = 1.0,
) -> FloatGrid:
    """Remove the disc from a picture of it.

    Args:
        image: (side, side) light about the middle, background taken off.
        noise: Its standard deviation.
        core: Fitted to it.
        offset_px: (y, x) of the core from the middle.
        pitch_px: Of the samples between which both were interpolated.

    Returns:
        (side, side) the light as if all of it had come from a point.

    Raises:
        DecodeError: If the disc hides too much of the core.
    """
    half = image.shape[-1] // 2
    offset = np.arange(-half, half + 1, dtype=np.float64)
    y, x = np.meshgrid(offset - offset_px[0], offset - offset_px[1], indexing="ij")
    radius, square = np.hypot(y, x), core.spread_px**2
    at_origin = replace(core, y=0.0, x=0.0)
    residual = image - at_origin.at(y, x)
    rest = _wide(smooth_noise(residual, noise), core.diameter_px)
    disc, frequency = _spectrum_of(rest.shape[0], core.diameter_px)
    window = _fade(radius, core.diameter_px / 2 + 2 * core.spread_px) / core.light
    power = np.abs(fft.rfft2(_wide(residual * window, core.diameter_px, dark=True))) ** 2
    noise_power = pitch_px**2 * float(np.square(noise * window).sum())
    gain = _gain(disc, frequency, core, power, noise_power)
    spectrum = fft.rfft2(rest)
    inside = slice((rest.shape[0] - image.shape[0]) // 2, None)
    close, distant = (
        fft.irfft2(spectrum * g, s=rest.shape)[inside, inside][: image.shape[0], : image.shape[1]]
        for g in (gain, disc / (disc**2 + FAR_REGULAR * (1 - disc) ** 2))
    )
    share = _fade(radius, CLOSE_SPREADS * core.spread_px)
    gauss = core.light / (2 * np.pi * square) * np.exp(-(radius**2) / (2 * square))
    return np.asarray(gauss + share * close + (1 - share) * distant)


def _fade(radius: FloatGrid, start: float) -> FloatGrid:
    return np.asarray(np.cos(np.pi / 2 * np.clip((radius - start) / CORE_PX, 0, 1)) ** 2)


def _gain(
    disc: FloatGrid, frequency: FloatGrid, core: DiscCore, observed: FloatGrid, noise_power: float
) -> FloatGrid:
    """Return the factor on the spectrum of the remainder that makes the error least.

    Args:
        disc: Spectrum of the disc.
        frequency: Of its samples, in cycles/pixel.
        core: The Gaussian; all light is that of it.
        observed: Power of the rest near the core; the light as 1.
        noise_power: What of it is noise, at any frequency.

    Raises:
        DecodeError: If disc and noise hide too much of the core.
    """
    ring = np.rint(frequency / RING_STEP).astype(np.intp)
    # the power of what the disc blurred, by least squares over rings as wide as some of its zeros
    fitted = [
        np.convolve(np.bincount(ring.ravel(), power.ravel()), np.ones(RINGS), mode="same")
        for power in ((observed - noise_power) * disc**2, disc**4)
    ]
    rest = np.maximum(fitted[0] / np.maximum(fitted[1], _LEAST_POWER), 0.0)[ring]
    gain = disc * rest / (disc**2 * rest + noise_power)
    power = rest + np.exp(-4 * (np.pi * core.spread_px * frequency) ** 2)
    # the spectrum is its own mirror image along x: all but the first column stand for two
    weight = np.where(np.arange(frequency.shape[1]) > 0, 2.0, 1.0) * power
    hidden = float((weight * noise_power / (disc**2 * power + noise_power)).sum() / weight.sum())
    if hidden > MOST_HIDDEN:
        raise DecodeError(
            f"a disc of {core.diameter_px:g} px is too large for a blur of {core.spread_px:.2f} px "
            f"(standard deviation) and this noise: it hides {hidden:.1%} of the core, more than "
            f"{MOST_HIDDEN:.0%}; take a smaller pinhole or more light"
        )
    return np.asarray(gain)


def with_disc(kernel: FloatGrid, diameter_px: float) -> FloatGrid:
    """Blur a (side, side) kernel by a disc of unit sum; beyond the kernel it is dark."""
    side = kernel.shape[-1]
    wide = _wide(kernel, diameter_px, dark=True)
    disc, _ = _spectrum_of(wide.shape[0], diameter_px)
    first = (wide.shape[0] - side) // 2
    inside = slice(first, first + side)
    return np.asarray(fft.irfft2(fft.rfft2(wide) * disc, s=wide.shape)[inside, inside])


def _wide(image: FloatGrid, diameter_px: float, *, dark: bool = False) -> FloatGrid:
    """Pad (side, side) so far that a disc does not wrap around, to a side with a fast FFT."""
    side = image.shape[0]
    wide = fft.next_fast_len(side + 2 * (int(np.ceil(diameter_px)) + _MARGIN_PX), real=True)
    margin = (wide - side) // 2
    widths = (margin, wide - side - margin)
    return np.pad(image, widths) if dark else np.pad(image, widths, mode="symmetric")


def _spectrum_of(side: int, diameter_px: float) -> tuple[FloatGrid, FloatGrid]:
    frequency = np.hypot(fft.fftfreq(side)[:, None], fft.rfftfreq(side)[None])
    return disc_spectrum(frequency, diameter_px), frequency
