"""Nearer than the focus: the kernels of other object distances from the bundle."""

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.report.stress.scenario import Scenario, photographs
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.twin import Lens, Shot
from camkit.runtime.bank.psf import color_kernels, kernel_at
from camkit.units import MM_PER_M


def _applies(bundle: Bundle) -> str | None:
    psf = bundle.stress_psf()
    if psf is None:
        return "it holds no stress_psf.safetensors"
    if bundle.manifest.object_distance_mm is not None:
        return "it is not focused at infinity"
    if not np.isinf(psf.depths_mm[-1]):
        return "its stress PSF does not reach infinity"
    return photographs(bundle)


def _lens_at(bundle: Bundle, inverse_m: float) -> Lens:
    """Give the lens for one object distance."""
    psf = bundle.stress_psf()
    assert psf is not None
    camera = bundle.manifest.camera
    response = camera.channel_response.to_arrays()
    depth_mm = MM_PER_M / inverse_m if inverse_m else np.inf
    kernels = color_kernels(psf, *response, depth_mm=depth_mm)
    return Lens(
        psf=bundle.psf,
        kernels_at=lambda x, y: kernel_at(kernels, psf.field_heights_mm, x, y),
        margin_px=kernels.shape[-1] // 2,
    )


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    light = rig.light(scene, _lens_at(rig.bundle, value))
    return rig.record(light)


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
    note="0 is infinity, 0.2 is 5 m; kernels from the bundle's stress PSF, which has fewer fields.",
)
