"""Depth of few photons."""

from camkit.report.kinds.spad.stress.applies import has_times
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_DEPTH
from camkit.report.kinds.spad.stress.shot import DepthSetting, DepthShot
from camkit.report.stress.scenario import Scenario


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> DepthShot:
    return judge.scan(scene, DepthSetting(photons=value))


SCENARIO = Scenario(
    name="depth_photons",
    title="Depth: photons",
    knob="signal photons of a pixel",
    unit="",
    values=(1.0, 3.0, 10.0, 20.0, 30.0, 60.0, 100.0, 300.0, 1000.0, 10000.0),
    nominal=1000.0,
    quick=(10.0, 30.0, 1000.0),
    shoot=_shoot,
    applies=has_times,
    log=True,
    note=f"SBR 3. {OF_DEPTH}",
)
