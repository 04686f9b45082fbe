"""Depth in background light."""

from camkit.report.kinds.spad.stress.applies import has_times
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_DEPTH
from camkit.report.kinds.spad.stress.shot import DepthSetting, DepthShot
from camkit.report.stress.scenario import Scenario


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> DepthShot:
    return judge.scan(scene, DepthSetting(sbr=value))


SCENARIO = Scenario(
    name="depth_sbr",
    title="Depth: signal over background",
    knob="SBR",
    unit="",
    values=(0.01, 0.03, 0.1, 0.2, 0.3, 1.0, 3.0, 10.0),
    nominal=3.0,
    quick=(0.03, 0.3, 3.0),
    shoot=_shoot,
    applies=has_times,
    log=True,
    note=f"1000 signal photons of a pixel on average. {OF_DEPTH}",
)
