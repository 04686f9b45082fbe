"""Wires and edges where streaks would lie: straight lines through lights, along the arms."""

import numpy as np

from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import with_line, writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene

LINES = 6


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    lit = judge.lit(scene)
    if value == 0:
        return judge.shoot(lit)
    streaks, linear = judge.rig.bundle.streaks, lit.linear
    rng = np.random.default_rng(7_400 + scene.number)
    places = np.argwhere(linear.max(axis=0) > 1)
    for _ in range(LINES):
        y, x = places[rng.integers(len(places))]
        angle_rad = float(rng.choice(streaks.angles_rad))
        reach_px = float(streaks.reach_px * scene.scale)
        linear = with_line(linear, (float(y), float(x)), angle_rad, reach_px, value / 100)
    return judge.shoot(lit.showing(linear, f"{lit.name} lines {value:g}"))


SCENARIO = Scenario(
    name="streak_like_edges",
    title="Edges that look like streaks",
    knob="line_percent",
    unit="%",
    values=(0.0, 2.0, 5.0, 10.0, 20.0, 50.0),
    nominal=0.0,
    quick=(0.0, 10.0),
    shoot=_shoot,
    applies=writes_streaks,
    rival=False,
    note="Six lines of the scene itself, through clipped places, along arms and as long as they; "
    "so many per cent of white.",
)
