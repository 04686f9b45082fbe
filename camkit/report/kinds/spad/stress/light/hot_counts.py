"""One pixel in a hundred is hot, and nobody knows."""

from typing import Final

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.light.hot_pixels import hot_mask
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario

SHARE: Final = 0.01


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    hot = hot_mask(judge.studio.shape, SHARE, scene.number)
    setting = PictureSetting(hot=hot, hot_counts=value, hot_known=False)
    return judge.shoot(scene, setting, with_chi2=True)


SCENARIO = Scenario(
    name="hot_counts",
    title="Hot pixels, unknown",
    knob="counts of a hot pixel",
    unit="",
    values=(0.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0, 100000.0),
    nominal=0.0,
    quick=(0.0, 300.0, 10000.0),
    shoot=_shoot,
    applies=makes_finer,
    log=True,
    note=f"White counts 10,000. {OF_PICTURES}",
)
