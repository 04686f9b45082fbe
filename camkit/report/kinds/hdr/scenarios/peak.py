"""Faint lights, and lights beyond any that networks saw: their range is stretched."""

from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import with_peak, writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    lit = judge.lit(scene)
    return judge.shoot(lit.showing(with_peak(lit.linear, value), f"{lit.name} peak {value:g}"))


SCENARIO = Scenario(
    name="peak",
    title="Brightest light",
    knob="peak",
    unit="x white",
    values=(2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0),
    nominal=256.0,
    quick=(4.0, 256.0, 4096.0),
    shoot=_shoot,
    log=True,
    applies=writes_streaks,
    rival=False,
    note="The same lights, the logarithm of their brightness scaled. PSNR has the peak 2^8 "
    "throughout.",
)
