"""Hot pixels in a scan, which nobody states: they are found and painted over."""

from typing import Final

from camkit.report.kinds.spad.stress.applies import has_times
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.light.hot_pixels import hot_mask
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_DEPTH
from camkit.report.kinds.spad.stress.shot import DepthSetting, DepthShot
from camkit.report.stress.scenario import Scenario

HOT_COUNTS: Final = 50.0


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> DepthShot:
    hot = hot_mask(judge.studio.shape, value, scene.number)
    return judge.scan(scene, DepthSetting(hot=hot, hot_counts=HOT_COUNTS))


SCENARIO = Scenario(
    name="depth_hot",
    title="Depth: hot pixels",
    knob="share of pixels",
    unit="",
    values=(0.0, 0.003, 0.01, 0.03, 0.1, 0.2, 0.4),
    nominal=0.0,
    quick=(0.0, 0.01, 0.1),
    shoot=_shoot,
    applies=has_times,
    note="A hot pixel counts 50 more in every bin. Sub-pixels of hot pixels are not believed. "
    f"{OF_DEPTH}",
)
