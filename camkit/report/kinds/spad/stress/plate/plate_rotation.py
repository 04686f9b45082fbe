"""A plate that was put in at an angle: its dots are turned about the middle one."""

import math

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.kernels import turned
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    kernel = turned(judge.studio.camera.kernel, math.radians(value))
    return judge.shoot(scene, PictureSetting(kernel=kernel), with_chi2=True)


SCENARIO = Scenario(
    name="plate_rotation",
    title="Rotation of the plate",
    knob="rotation_deg",
    unit="deg",
    values=(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0),
    nominal=0.0,
    quick=(0.0, 4.0, 10.0),
    shoot=_shoot,
    applies=makes_finer,
    note=OF_PICTURES,
)
