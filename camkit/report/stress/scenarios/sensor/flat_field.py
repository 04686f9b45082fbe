"""Nothing to see: constant coloured fields down to black, on which some networks explode."""

import numpy as np

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting

COLOUR = (0.9, 0.5, 0.4)


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    field = np.ones_like(scene.linear) * np.array(COLOUR, np.float32)[:, None, None]
    flat = scene.showing(field, f"flat/{scene.name}")
    setting = Setting(exposure=2.0**value)
    return rig.shoot(flat, setting=setting)


SCENARIO = Scenario(
    name="flat_field",
    title="Constant fields, down to black",
    knob="level_ev",
    unit="EV",
    values=(-14.0, -10.0, -8.0, -6.0, -4.0, -2.0, 0.0),
    nominal=0.0,
    quick=(-14.0, 0.0),
    shoot=_shoot,
    rival=False,
    note="A field of one colour with noise. Blur does no harm here, so doing nothing wins; a "
    "method breaks if what it gives does not explain the capture, or is not bounded.",
)
