"""Less noise than the sensor has in one frame: many frames averaged into one file."""

from dataclasses import replace

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting

FILE_BITS = 16


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    shot = rig.shoot(scene, setting=Setting(noise_factor=value**-0.5, bits=FILE_BITS))
    return replace(shot, capture=replace(shot.capture, noise=shot.noise))


SCENARIO = Scenario(
    name="frame_average",
    title="Frames averaged",
    knob="frames",
    unit="frames",
    values=(1.0, 4.0, 16.0, 64.0, 256.0),
    nominal=1.0,
    quick=(1.0, 64.0),
    shoot=_shoot,
    log=True,
    bounds={"grey_noise": "low"},
    note="At ISO 100; the file has 16 bits and states its noise.",
)
