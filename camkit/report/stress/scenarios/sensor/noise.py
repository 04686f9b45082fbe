"""Low light: the sensitivity rises, the exposure on the sensor falls with it."""

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    return rig.shoot(scene, setting=Setting(iso=value))


SCENARIO = Scenario(
    name="noise",
    title="Noise: sensitivity",
    knob="iso",
    unit="ISO",
    values=(50.0, 100.0, 400.0, 1600.0, 3200.0, 6400.0, 12800.0, 25600.0),
    nominal=100.0,
    quick=(100.0, 12800.0),
    shoot=_shoot,
    log=True,
    bounds={"grey_noise": "both"},
    note="The picture is equally bright at every ISO; the file states the ISO. Below the lowest "
    "ISO of a sensor its noise stays: such a camera only exposes longer.",
)
