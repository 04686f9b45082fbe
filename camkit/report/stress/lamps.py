"""The spectra and colours of lights: black bodies, LED, lasers."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.colorimetry import rec709_of_light

Spectrum = Callable[[NDArray[np.float64]], NDArray[np.float64]]
SECOND_RADIATION_UM_K: Final = 14387.77
"""hc / k (CODATA 2018)."""
DAYLIGHT_K: Final = 6500.0
SPLIT_K: Final = 4000.0
WARM: Final = (
    (-0.2661239, -0.2343589, 0.8776956, 0.179910),
    (-0.9549476, -1.37418593, 2.09137015, -0.16748867),
)
COLD: Final = (
    (-3.0258469, 2.1070379, 0.2226347, 0.240390),
    (3.0817580, -5.87338670, 3.75112997, -0.37001483),
)
"""Cubics of x over 1000 / kelvin, and of y over x."""


def planck(kelvin: float) -> Spectrum:
    """Return the radiance of a black body over wavelength, 1 at 0.56 um.

    References: Planck's law.
    """

    def radiance(um: NDArray[np.float64]) -> NDArray[np.float64]:
        return um**-5 / np.expm1(SECOND_RADIATION_UM_K / (um * kelvin))

    return lambda um: radiance(um) / radiance(np.array(0.56))


def bands(*peaks: tuple[float, float, float]) -> Spectrum:
    """Return Gaussian bands (centre_um, full width at half maximum in um, height)."""

    def spectrum(um: NDArray[np.float64]) -> NDArray[np.float64]:
        parts = [h * np.exp(-4 * np.log(2) * ((um - c) / w) ** 2) for c, w, h in peaks]
        return np.asarray(np.sum(parts, axis=0))

    return spectrum


LIGHTS: Final[dict[str, Spectrum]] = {
    "as frozen": np.ones_like,
    "D65 (6504 K)": planck(6504),
    "shade (12000 K)": planck(12000),
    "A (2856 K)": planck(2856),
    "white LED": bands((0.452, 0.022, 1.0), (0.555, 0.120, 0.75)),
    "RGB LED": bands((0.460, 0.022, 1.0), (0.525, 0.032, 1.0), (0.630, 0.018, 1.0)),
    "RGB lasers": bands((0.450, 0.004, 1.0), (0.532, 0.004, 1.0), (0.638, 0.004, 1.0)),
    "deep RGB LED": bands((0.425, 0.015, 1.0), (0.500, 0.015, 1.0), (0.670, 0.015, 1.0)),
}
"""From the light that the bundle's kernels are weighted for to the farthest from it."""


def planckian(kelvin: float) -> tuple[float, float]:
    """Return the CIE 1931 chromaticity (x, y) of a black body of 2222 to 25000 K.

    References: Kang et al. 2002, J. Korean Phys. Soc. 41, 865, eq. (5), (6): cubic splines.
    """
    x_terms, y_terms = WARM if kelvin <= SPLIT_K else COLD
    x = float(np.polyval(x_terms, 1e3 / kelvin))
    return x, float(np.polyval(y_terms, x))


def tint(kelvin: float) -> NDArray[np.float64]:
    """Return the factors on linear Rec.709 of a light against daylight, the largest 1."""
    light, daylight = (rec709_of_light(planckian(k)) for k in (kelvin, DAYLIGHT_K))
    factors = np.maximum(light / daylight, 0)
    return np.asarray(factors / factors.max())
