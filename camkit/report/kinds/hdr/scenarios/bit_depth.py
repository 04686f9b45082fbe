"""Fewer steps of the converter than the camera has."""

from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.runtime.twin.exposure import Setting


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    return judge.shoot(judge.lit(scene), setting=Setting(bits=round(value)))


SCENARIO = Scenario(
    name="bit_depth",
    title="Bit depth",
    knob="bits",
    unit="bit",
    values=(8.0, 10.0, 12.0, 14.0),
    nominal=12.0,
    quick=(8.0, 12.0),
    shoot=_shoot,
    bounds={"bit_depth": "low"},
    applies=writes_streaks,
    rival=False,
    note="Lights of 1.5 % of the picture. Faint streaks are less than a step of 8 bits.",
)
