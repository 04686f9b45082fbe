"""Sensor defects: samples stuck at black or at white."""

import numpy as np

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot, spoil


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    shot = judge.rig.shoot(scene)
    return spoil(shot, value, (np.floor(shot.capture.white_level), 0), seed=7_200)


SCENARIO = Scenario(
    name="dead_pixels",
    title="Dead and hot pixels",
    knob="dead_percent",
    unit="%",
    values=(0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0),
    nominal=0.0,
    quick=(0.0, 1.0),
    shoot=_shoot,
    log=True,
    bounds={"broken_fraction": "high"},
    note="Half of them stuck at black, half at white.",
)
