"""More noise than the file states: heat, long exposures, an amplifier that lies."""

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    setting = Setting(iso=400.0, noise_factor=value)
    return rig.shoot(scene, setting=setting)


SCENARIO = Scenario(
    name="noise_above_stated",
    title="Noise above what the file states",
    knob="noise_factor",
    unit="x",
    values=(1.0, 1.5, 2.0, 3.0, 4.0, 8.0),
    nominal=1.0,
    quick=(1.0, 4.0),
    shoot=_shoot,
    log=True,
    note="At ISO 400; the factor is on the standard deviation of all noise, and no method is told.",
)
