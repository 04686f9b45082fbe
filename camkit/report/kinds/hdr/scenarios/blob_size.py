"""One large light: the larger what clips, the less of its streaks tells of its middle."""

import numpy as np

from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import dimmed, with_lamp, writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene

POWER = 64.0


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    dark = dimmed(judge.lit(scene).linear)
    height, width = dark.shape[1:]
    rng = np.random.default_rng(7_200 + scene.number)
    centre = rng.uniform(0.3, 0.7) * height, rng.uniform(0.3, 0.7) * width
    lamp = with_lamp(dark, centre, value * scene.scale, POWER)
    return judge.shoot(scene.showing(lamp, f"{scene.name} lamp {value:g}"))


SCENARIO = Scenario(
    name="blob_size",
    title="Size of a clipped light",
    knob="radius_px",
    unit="px",
    values=(5.0, 10.0, 20.0, 40.0, 80.0),
    nominal=5.0,
    quick=(5.0, 40.0),
    shoot=_shoot,
    log=True,
    applies=writes_streaks,
    rival=False,
    note="One round lamp 64 times white in a dark scene.",
)
