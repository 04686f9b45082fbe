"""A decentred lens: its axis meets the sensor beside the middle."""

from camkit.report.stress.scenario import Scenario, varies_over_field
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.light import with_axis_moved


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    lens = with_axis_moved(rig.lens, 0.6 * value, 0.8 * value) if value else None
    return rig.shoot(scene, lens)


SCENARIO = Scenario(
    name="decentre",
    title="Decentred lens",
    knob="decentre_mm",
    unit="mm",
    values=(0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0),
    nominal=0.0,
    quick=(0.0, 1.0),
    shoot=_shoot,
    applies=varies_over_field,
    note="The PSFs move, distortion and illumination stay.",
)
