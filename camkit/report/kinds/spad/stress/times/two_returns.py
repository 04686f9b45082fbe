"""A second surface behind the first, as bright, in the middle of the picture."""

from typing import Final

from camkit.report.kinds.spad.stress.applies import has_times
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.shot import DepthSetting, DepthShot
from camkit.report.stress.scenario import Scenario

PHOTONS: Final = 4000.0


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> DepthShot:
    return judge.scan(scene, DepthSetting(photons=PHOTONS, behind_ps=value))


SCENARIO = Scenario(
    name="two_returns",
    title="Depth: two surfaces",
    knob="apart_ps",
    unit="ps",
    values=(25.0, 50.0, 75.0, 100.0, 150.0, 200.0, 400.0, 600.0, 900.0),
    nominal=900.0,
    quick=(50.0, 200.0, 900.0),
    shoot=_shoot,
    applies=has_times,
    note="4000 signal photons of a pixel on average, over both surfaces. The nearer surface is "
    "judged; a way is broken where it finds both, within 100 ps and half of what they lie apart, "
    "in less than half of the middle.",
)
