"""Lamps beside the picture, whose streaks fall into it."""

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import with_lamp, writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene

RING_PX = 72
NEAREST_PX, FARTHEST_PX = 8.0, 64.0
RADIUS_PX = 4.0
POWER = 128.0


def _surrounded(scene: Scene, lit: FloatArray, lamps: int) -> FloatArray:
    """Return a scene and what lies around it: its mirror image, and lamps."""
    ring, scale = RING_PX * scene.scale, scene.scale
    around = np.pad(lit, ((0, 0), (ring, ring), (ring, ring)), mode="symmetric")
    height, width = lit.shape[1:]
    rng = np.random.default_rng(7_300 + scene.number)
    for _ in range(lamps):
        away = scale * rng.uniform(NEAREST_PX, FARTHEST_PX)
        along = rng.uniform(0.1, 0.9)
        sides = (
            (-away, along * width),
            (height + away, along * width),
            (along * height, -away),
            (along * height, width + away),
        )
        y, x = sides[int(rng.integers(4))]
        around = with_lamp(around, (y + ring, x + ring), scale * RADIUS_PX, POWER)
    return around


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    lit = judge.lit(scene)
    return judge.shoot(lit, around=_surrounded(scene, lit.linear, round(value)))


SCENARIO = Scenario(
    name="light_outside",
    title="Lamps outside the picture",
    knob="lamps",
    unit="",
    values=(0.0, 1.0, 2.0, 4.0, 8.0),
    nominal=0.0,
    quick=(0.0, 4.0),
    shoot=_shoot,
    applies=writes_streaks,
    rival=False,
    note="Round lamps of 4 px radius, 128 times white, 8 to 64 px beside the border. Beyond it the "
    "scene goes on as its mirror image.",
)
