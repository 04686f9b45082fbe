"""A lens that is focused elsewhere than the bundle says: its arms are longer or shorter."""

from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import stretched, writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    if value == 0:
        return judge.shoot(judge.lit(scene))
    streaks = stretched(judge.rig.bundle.streaks, 1 + value / 100)
    return judge.shoot(judge.lit(scene), lens=judge.lens_of(streaks))


SCENARIO = Scenario(
    name="wrong_depth",
    title="Focus at another distance",
    knob="length_percent",
    unit="%",
    values=(-10.0, -5.0, -2.0, 0.0, 2.0, 5.0, 10.0),
    nominal=0.0,
    quick=(-5.0, 0.0, 5.0),
    shoot=_shoot,
    applies=writes_streaks,
    rival=False,
    note="By so much the arms are longer than the bundle says. A 50 mm lens refocused from 5 m to "
    "1 m makes them 4.2 % longer, one refocused to infinity 1 % shorter.",
)
