"""Fewer steps of the converter than the camera has."""

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    setting = Setting(bits=round(value))
    return rig.shoot(scene, setting=setting)


SCENARIO = Scenario(
    name="bit_depth",
    title="Bit depth",
    knob="bits",
    unit="bit",
    values=(5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 14.0),
    nominal=12.0,
    quick=(8.0, 12.0),
    shoot=_shoot,
    bounds={"bit_depth": "low"},
    note="Black keeps its share of the range; the file states levels, not the steps' noise.",
)
