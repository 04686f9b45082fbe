"""A plate etched too deep: light goes into other orders of its heights."""

from typing import Final

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.kernels import etched
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario

LEVELS: Final = 8


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    kernel = etched(judge.studio.camera.kernel, LEVELS, value / 100)
    return judge.shoot(scene, PictureSetting(kernel=kernel), with_chi2=True)


SCENARIO = Scenario(
    name="etch_depth",
    title="Depth of etching",
    knob="depth_error_percent",
    unit="%",
    values=(0.0, 2.0, 5.0, 8.0, 10.0, 12.0, 15.0, 20.0, 30.0),
    nominal=0.0,
    quick=(0.0, 10.0, 30.0),
    shoot=_shoot,
    applies=makes_finer,
    note="All depths of a plate of 8 levels are off by one factor; too flat is alike. "
    f"{OF_PICTURES}",
)
