"""Dark counts that differ from pixel to pixel, of which nobody knows."""

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.light.dark_map import dark_map
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    dark = dark_map(judge.studio.shape, value, scene.number)
    return judge.shoot(scene, PictureSetting(dark=dark, dark_known=False), with_chi2=True)


SCENARIO = Scenario(
    name="dark_unknown",
    title="Dark counts, unknown",
    knob="dark counts of a pixel",
    unit="",
    values=(0.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0),
    nominal=0.0,
    quick=(0.0, 100.0, 1000.0),
    shoot=_shoot,
    applies=makes_finer,
    log=True,
    note=f"As with a known map, but nothing is taken off. {OF_PICTURES}",
)
