"""A gate scan that is taken for a histogram: the pulse runs the other way."""

from dataclasses import replace

from camkit.report.kinds.spad.stress.applies import has_times
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_DEPTH
from camkit.report.kinds.spad.stress.shot import DepthSetting, DepthShot
from camkit.report.stress.scenario import Scenario


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> DepthShot:
    axis, pulse = judge.studio.times()
    other = replace(axis, orientation="histogram" if axis.orientation == "gate" else "gate")
    return judge.scan(scene, DepthSetting(believed=(axis if value == 0 else other, pulse)))


SCENARIO = Scenario(
    name="orientation",
    title="Depth: orientation",
    knob="orientation",
    unit="",
    values=(0.0, 1.0),
    nominal=0.0,
    quick=(0.0, 1.0),
    shoot=_shoot,
    applies=has_times,
    labels=("as it is", "the other"),
    note=OF_DEPTH,
)
