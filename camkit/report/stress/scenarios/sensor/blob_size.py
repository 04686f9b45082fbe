"""One large light: the larger what clips, the less is known of its middle."""

from dataclasses import replace

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scenarios.sensor.saturated_area import with_discs
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    shot = rig.record(scene, rig.light(with_discs(scene, value, 1), rig.lens))
    return replace(shot, away_from_clipped=True)


SCENARIO = Scenario(
    name="blob_size",
    title="Size of a clipped light",
    knob="radius_px",
    unit="px",
    values=(2.0, 5.0, 10.0, 20.0, 40.0, 80.0),
    nominal=2.0,
    quick=(2.0, 40.0),
    shoot=_shoot,
    log=True,
    note="One disc 8 times white; judged away from what clipped.",
)
