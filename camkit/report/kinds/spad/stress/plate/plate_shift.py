"""A plate that was put in beside its place: a shift in the pupil moves no light on the sensor."""

from typing import Final

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario

APERTURE_MM: Final = 14.0
"""Of the plate and of its stop: 16 units of 0.873 mm."""


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    covered = (1 - abs(value) / APERTURE_MM) ** 2
    return judge.shoot(scene, PictureSetting(plate_light=covered), with_chi2=True)


SCENARIO = Scenario(
    name="plate_shift",
    title="Shift of the plate",
    knob="shift_mm",
    unit="mm",
    values=(-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0),
    nominal=0.0,
    quick=(-2.0, 0.0, 2.0),
    shoot=_shoot,
    applies=makes_finer,
    note="Along both axes. The light of every dot gets a phase alone; what is modelled is the "
    "light of a square stop, 14 mm wide and dark beside the plate, that no longer goes "
    f"through it. {OF_PICTURES}",
)
