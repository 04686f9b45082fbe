"""A free-running array: the first photon of a cycle hides later ones; corrected for."""

from dataclasses import replace

from camkit.report.kinds.spad.stress.applies import has_times
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_DEPTH
from camkit.report.kinds.spad.stress.shot import DepthSetting, DepthShot
from camkit.report.stress.scenario import Scenario


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> DepthShot:
    axis = replace(judge.studio.times()[0], orientation="histogram")
    return judge.scan(scene, DepthSetting(axis=axis, chance=value))


SCENARIO = Scenario(
    name="pile_up_free",
    title="Depth: pile-up, free running",
    knob="chance of the brightest bin",
    unit="",
    values=(0.01, 0.05, 0.1, 0.2, 0.3, 0.45, 0.7, 0.95),
    nominal=0.01,
    quick=(0.01, 0.2, 0.95),
    shoot=_shoot,
    applies=has_times,
    log=True,
    note="The chance that the brightest pixel counts a photon, in its brightest bin, of a "
    f"cycle. {OF_DEPTH}",
)
