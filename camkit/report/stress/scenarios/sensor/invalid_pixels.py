"""NaN and infinities in a float capture: one of them must not turn a picture black."""

import numpy as np

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot, spoil


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    shot = judge.rig.shoot(scene)
    return spoil(shot, value, (np.nan, np.inf, -np.inf), seed=7_300)


SCENARIO = Scenario(
    name="invalid_pixels",
    title="NaN and infinite pixels",
    knob="invalid_percent",
    unit="%",
    values=(0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0),
    nominal=0.0,
    quick=(0.0, 1.0),
    shoot=_shoot,
    log=True,
    bounds={"broken_fraction": "high"},
    note="Half NaN, a quarter each of the infinities, in a float mosaic.",
)
