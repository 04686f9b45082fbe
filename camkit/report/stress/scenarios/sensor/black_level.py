"""A black level that is not the sensor's: warm electronics, a converter of another setting."""

from dataclasses import replace

import numpy as np

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    shot = judge.rig.shoot(scene)
    black, white = shot.capture.black_level, shot.capture.white_level
    stated = black + np.float32(value / 100) * (np.float32(white) - black)
    return replace(shot, capture=replace(shot.capture, black_level=stated.astype(np.float32)))


SCENARIO = Scenario(
    name="black_level",
    title="Black level",
    knob="black_error_percent",
    unit="%",
    values=(-3.0, -1.0, -0.3, -0.1, 0.0, 0.1, 0.3, 1.0, 3.0),
    nominal=0.0,
    quick=(-1.0, 0.0, 1.0),
    shoot=_shoot,
    note="The file states a black that lies so much of the way to white above the true one; below "
    "0 all is brighter than it was. Nothing tells the methods, nor the input.",
)
