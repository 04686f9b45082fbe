"""A plate that was put in at an angle: all arms are turned."""

import math

from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import turned, writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    if value == 0:
        return judge.shoot(judge.lit(scene))
    return judge.shoot(
        judge.lit(scene), lens=judge.lens_of(turned(judge.rig.bundle.streaks, math.radians(value)))
    )


SCENARIO = Scenario(
    name="plate_rotation",
    title="Rotation of the plate",
    knob="rotation_deg",
    unit="deg",
    values=(0.0, 0.25, 0.5, 1.0, 1.5, 2.0),
    nominal=0.0,
    quick=(0.0, 1.0),
    shoot=_shoot,
    applies=writes_streaks,
    rival=False,
    note="The methods have the arms as the bundle states them.",
)
