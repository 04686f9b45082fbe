"""A turned element: every kernel turned about its chief ray."""

import numpy as np

from camkit.report.stress.kernel_change import transform_kernels
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.light import with_kernels


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    angle_rad = float(np.deg2rad(value))
    lens = None
    if value:
        lens = with_kernels(rig.lens, lambda k: transform_kernels(k, 1.0, angle_rad))
    return rig.shoot(scene, lens)


SCENARIO = Scenario(
    name="psf_rotation",
    title="Rotation of the PSF",
    knob="rotation_deg",
    unit="deg",
    values=(0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 45.0),
    nominal=0.0,
    quick=(0.0, 10.0),
    shoot=_shoot,
)
