"""The spectrum of the light: each lamp weights the wavelengths of the PSF in its own way."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.report.stress.rig import Rig
from camkit.report.stress.scenario import Scenario, photographs
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.light import Lens

Spectrum = Callable[[NDArray[np.float64]], NDArray[np.float64]]
SECOND_RADIATION_UM_K = 14387.77
"""hc / k (CODATA 2018)."""
GRID_UM = np.linspace(0.40, 0.70, 301)


def _applies(bundle: Bundle) -> str | None:
    if bundle.manifest.has_kernels and bundle.psf.wavelengths_um.size < 2:
        return "its PSF knows one wavelength"
    return photographs(bundle)


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


LIGHTS: dict[str, Spectrum] = {
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


def lens_under(rig: Rig, spectrum: Spectrum) -> Lens:
    """Return the lens and white balance under a light, the frozen response being that at 1."""
    wavelengths_um, response = rig.sensor.response_arrays()
    fine = np.stack([np.interp(GRID_UM, wavelengths_um, r, 0, 0) for r in response])
    lit = fine * spectrum(GRID_UM)
    gains = fine.sum(axis=1) / lit.sum(axis=1)
    middle = gains[gains.size // 2]
    lens = rig.lens_under((GRID_UM, lit))
    return replace(lens, gains=tuple(float(gain / middle) for gain in gains))


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    lens = lens_under(rig, list(LIGHTS.values())[round(value)])
    usual = rig.light(scene).gains
    gains = tuple(a * b for a, b in zip(usual, lens.gains or usual, strict=True))
    return rig.shoot(scene, replace(lens, gains=gains))


SCENARIO = Scenario(
    name="illuminant",
    title="Spectrum of the light",
    knob="illuminant",
    unit="",
    values=tuple(float(i) for i in range(len(LIGHTS))),
    nominal=0.0,
    quick=(0.0, 6.0),
    shoot=_shoot,
    applies=_applies,
    labels=tuple(LIGHTS),
    note="Kernels and white balance change, the colours of the scene stay: colour errors of the "
    "matrix are another matter. The lights have no order; a break point names the first.",
)
