"""Networks are told that white is another number of photons."""

from typing import Final

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario

WRONG_PHOTONS: Final = 1000.0


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    return judge.shoot(scene, PictureSetting(photons=WRONG_PHOTONS, told=value), with_chi2=True)


SCENARIO = Scenario(
    name="wrong_photons",
    title="Wrong level of photons",
    knob="told over true photons",
    unit="",
    values=(0.1, 0.2, 0.5, 0.8, 1.0, 1.25, 2.0, 5.0, 10.0),
    nominal=1.0,
    quick=(0.1, 1.0, 10.0),
    shoot=_shoot,
    applies=makes_finer,
    log=True,
    rivals=("bare", "bare net", "bicubic", "linear"),
    note="1000 photons of white. The linear estimate needs no such number, so networks are "
    "held against it. chi^2 is the squared error over that on 10,000 photons, told right.",
)
