"""More and more of the picture clips: the exposure rises."""

from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    return judge.shoot(judge.lit(scene, value / 100))


SCENARIO = Scenario(
    name="saturated_area",
    title="Saturated area",
    knob="saturated_percent",
    unit="%",
    values=(0.3, 1.0, 1.5, 3.0, 6.0, 10.0),
    nominal=1.5,
    quick=(0.3, 1.5, 10.0),
    shoot=_shoot,
    log=True,
    bounds={"clipped_fraction": "high"},
    applies=writes_streaks,
    rival=False,
    note="Of the scene, by its exposure; lights end at 2^8 times white.",
)
