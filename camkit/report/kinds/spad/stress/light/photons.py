"""Few photons: the level below which an array does better without its plate."""

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    return judge.shoot(scene, PictureSetting(photons=value))


SCENARIO = Scenario(
    name="photons",
    title="Photons",
    knob="photons of white",
    unit="",
    values=(1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0),
    nominal=10000.0,
    quick=(10.0, 100.0, 10000.0),
    shoot=_shoot,
    applies=makes_finer,
    log=True,
    rivals=("bare", "bare net"),
    note="The array without a plate has as many photons in its pixels, and its own linear "
    "estimate.",
)
