"""Even background whose mean is known and taken off; its noise stays."""

from typing import Final

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario

SBR_PHOTONS: Final = 1000.0


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    return judge.shoot(scene, PictureSetting(sbr=value, photons=SBR_PHOTONS))


SCENARIO = Scenario(
    name="sbr",
    title="Signal over background",
    knob="SBR",
    unit="",
    values=(0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 1000.0),
    nominal=1000.0,
    quick=(0.1, 1.0, 1000.0),
    shoot=_shoot,
    applies=makes_finer,
    log=True,
    rivals=("bare", "bare net"),
    note="1000 photons of white; the mean of the background is taken off like dark counts.",
)
