"""Low light: the sensitivity rises, the exposure on the sensor falls with it."""

from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.runtime.twin.exposure import Setting


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    return judge.shoot(judge.lit(scene), setting=Setting(iso=value))


SCENARIO = Scenario(
    name="noise",
    title="Noise: sensitivity",
    knob="iso",
    unit="ISO",
    values=(100.0, 400.0, 1600.0, 6400.0, 25600.0),
    nominal=100.0,
    quick=(100.0, 6400.0),
    shoot=_shoot,
    log=True,
    bounds={"grey_noise": "both"},
    applies=writes_streaks,
    rival=False,
    note="Lights of 1.5 % of the picture, equally bright at every ISO; the file states the ISO.",
)
