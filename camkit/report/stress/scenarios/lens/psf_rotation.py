"""A turned element: every kernel turned about its chief ray."""

import numpy as np

from camkit.report.stress.kernel_change import with_transformed
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    angle_rad = float(np.deg2rad(value))
    return rig.shoot(scene, with_transformed(rig.lens, 1.0, angle_rad) if value else None)


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
