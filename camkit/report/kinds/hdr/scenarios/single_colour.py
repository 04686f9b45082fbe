"""Lights of one colour: the others hold no streaks to read."""

from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import with_colour, writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene

COLOURS = {
    "as it is": None,
    "white": (1.0, 1.0, 1.0),
    "red": (1.0, 0.02, 0.02),
    "amber": (1.0, 0.38, 0.02),
    "green": (0.02, 1.0, 0.1),
    "blue": (0.02, 0.1, 1.0),
}
"""Linear Rec.709 of the lights; where none exceeds white the scene is as it is."""


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    lit = judge.lit(scene)
    name, colour = list(COLOURS.items())[int(value)]
    if colour is None:
        return judge.shoot(lit)
    return judge.shoot(lit.showing(with_colour(lit.linear, colour), f"{lit.name} {name}"))


SCENARIO = Scenario(
    name="single_colour",
    title="Lights of one colour",
    knob="colour",
    unit="",
    values=tuple(float(number) for number in range(len(COLOURS))),
    nominal=0.0,
    quick=(0.0, 2.0, 5.0),
    shoot=_shoot,
    labels=tuple(COLOURS),
    applies=writes_streaks,
    rival=False,
    note="What exceeds white gets the colour, as bright as its strongest component was.",
)
