"""Nearer and farther than the focus: kernels of other object distances from the bundle."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.contracts import FrozenPsf
from camkit.report.stress.scenario import Scenario, photographs
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.light import Lens, lens_of, with_places
from camkit.runtime.twin.truth import light_sensor
from camkit.units import MM_PER_M, to_mm

FOCUS_WITHIN_PER_M = 0.01


def _applies(bundle: Bundle) -> str | None:
    psf = bundle.stress_psf()
    if psf is None:
        return "it holds no stress_psf.safetensors"
    if bundle.manifest.has_haze and bundle.stress_haze() is None:
        return "its stress PSF knows nothing of its haze"
    if psf.symmetry != "radial":
        return "its stress PSF is not that of a lens of revolution"
    if psf.depths_mm.size < 2 or _off_focus_per_m(bundle, psf).min() > FOCUS_WITHIN_PER_M:
        return "its stress PSF does not hold its focus and something beside it"
    return photographs(bundle)


def _inverse_per_m(psf: FrozenPsf) -> NDArray[np.float64]:
    """Return the distances of a PSF as 1 / m, far to near."""
    inverse: NDArray[np.float64] = np.round(MM_PER_M / psf.depths_mm[::-1], 6)
    return inverse


def _off_focus_per_m(bundle: Bundle, psf: FrozenPsf) -> NDArray[np.float64]:
    off: NDArray[np.float64] = np.abs(_inverse_per_m(psf) - MM_PER_M / bundle.reference_depth_mm)
    return off


def distances_of(bundle: Bundle) -> Scenario:
    """Return the scenario with the distances of a bundle's stress PSF; nominal is the focus."""
    psf = bundle.stress_psf()
    assert psf is not None
    values = tuple(float(value) for value in _inverse_per_m(psf))
    nominal = values[int(_off_focus_per_m(bundle, psf).argmin())]
    quick = tuple(sorted({values[0], nominal, values[len(values) // 2], values[-1]}))
    return replace(SCENARIO, values=values, nominal=nominal, quick=quick)


def _at_known_field(scene: Scene, bundle: Bundle) -> tuple[Scene, float]:
    """Put a scene where the stress PSF has a field, since far between its few it says nothing.

    Returns:
        The scene and the height of that field in millimetres.
    """
    psf, sensor = bundle.stress_psf(), bundle.manifest.sensor
    assert psf is not None
    free_px = np.hypot(sensor.width_px - scene.size_px[0], sensor.height_px - scene.size_px[1])
    reach_mm = max(to_mm(sensor.pixel_pitch_um) * float(free_px) / 2, 1e-9)
    within = psf.field_heights_mm[psf.field_heights_mm <= reach_mm]
    height_mm = float(within[scene.number % within.size])
    return replace(scene, share=height_mm / reach_mm), height_mm


def _lens_at(bundle: Bundle, inverse_m: float, height_mm: float) -> Lens:
    """Return the lens for one object distance, with the kernels of one field all around it."""
    psf = bundle.stress_psf()
    assert psf is not None
    depth_mm = MM_PER_M / inverse_m if inverse_m else np.inf
    within_mm = float(np.clip(depth_mm, psf.depths_mm[0], psf.depths_mm[-1]))  # inverse was rounded
    sensor, haze = light_sensor(bundle.manifest), bundle.stress_haze()
    lens = lens_of(psf, sensor, depth_mm=within_mm, haze=haze)

    def at_field(x_mm: float, y_mm: float) -> tuple[float, float]:
        scale = height_mm / max(np.hypot(x_mm, y_mm), 1e-9)
        return scale * x_mm, scale * y_mm

    return replace(with_places(lens, at_field), psf=bundle.psf)


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    placed, height_mm = _at_known_field(scene, rig.bundle)
    return rig.shoot(placed, _lens_at(rig.bundle, value, height_mm))


SCENARIO = Scenario(
    name="defocus",
    title="Object distance",
    knob="inverse_distance",
    unit="1/m",
    values=(0.0, 0.02, 0.05, 0.1, 0.2),
    nominal=0.0,
    quick=(0.0, 0.2),
    shoot=_shoot,
    applies=_applies,
    fit=distances_of,
    note="0 is infinity, 0.2 is 5 m; at the fields of the bundle's stress PSF, which has few. The "
    "methods are not told the distance.",
)
