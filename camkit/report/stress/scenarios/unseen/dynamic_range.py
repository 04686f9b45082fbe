"""Sun and shade in one picture: a range that no display shows, exposed for the sun."""

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting


def sunlit(scene: Scene, ratio: float) -> FloatArray:
    """Return a scene (3, h, w) one half of which is lit so many times as strongly.

    The edge of the shade runs through the middle, in a direction that the scene's number decides.
    """
    height, width = scene.linear.shape[1:]
    angle = np.pi * (scene.number % 8 + 0.5) / 4
    y, x = np.mgrid[:height, :width].astype(np.float32)
    away = np.cos(angle) * (x - (width - 1) / 2) + np.sin(angle) * (y - (height - 1) / 2)
    sun = np.clip(away + 0.5, 0, 1)
    return np.asarray(scene.linear * (1 + (ratio - 1) * sun), dtype=np.float32)


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    if value == 1:
        return rig.shoot(scene)
    lit = scene.showing(sunlit(scene, value), f"{scene.name} sun {value:g}")
    return rig.record(scene, rig.light(lit, rig.lens), Setting(exposure=1 / value))


SCENARIO = Scenario(
    name="dynamic_range",
    title="Range of the light: sun and shade",
    knob="range_factor",
    unit="x",
    values=(1.0, 4.0, 8.0, 16.0, 32.0, 64.0),
    nominal=1.0,
    quick=(1.0, 16.0),
    shoot=_shoot,
    log=True,
    note="Half of the scene is lit so many times as strongly. The exposure is for the sun, so that "
    "nothing clips; pictures are judged at the brightness of the shade, the sun ends at white.",
)
