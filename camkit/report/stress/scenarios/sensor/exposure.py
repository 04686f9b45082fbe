"""Too dark, too bright: the light on the sensor in steps of EV, brightened back afterwards."""

from dataclasses import replace

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    setting = Setting(exposure=2.0**value)
    shot = rig.shoot(scene, setting=setting)
    return replace(shot, away_from_clipped=True)


SCENARIO = Scenario(
    name="exposure",
    title="Exposure",
    knob="exposure_ev",
    unit="EV",
    values=(-6.0, -5.0, -4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 6.0),
    nominal=0.0,
    quick=(-6.0, 0.0, 2.0),
    shoot=_shoot,
    bounds={"signal_level": "both", "clipped_fraction": "high"},
    note="At ISO 100, judged away from clipped pixels and at the brightness of the scene: a "
    "method that is not linear in the light loses here.",
)
