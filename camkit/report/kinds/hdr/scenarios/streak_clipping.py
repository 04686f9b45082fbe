"""Streaks that fall on what is clipped too, where nobody sees them."""

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import dimmed, with_lamp, writes_streaks
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene

RADIUS_PX = 6.0
POWER = 128.0
FROM_PX = 12.0
WIDEST = 0.3
"""Of the shorter side: where the panel ends at the latest."""
PANEL = 3.0
"""Times white: it clips in every colour."""


def _panelled(dark: FloatArray, share: float, to_px: float, scale: int) -> FloatArray:
    """Return scene with a lamp in its middle, and a panel over a share of the circle around it."""
    height, width = dark.shape[1:]
    middle = (height - 1) / 2, (width - 1) / 2
    y, x = np.ogrid[:height, :width]
    far = np.hypot(y - middle[0], x - middle[1])
    turn = np.arctan2(y - middle[0], x - middle[1]) / (2 * np.pi) % 1
    panel = (far > FROM_PX * scale) & (far <= to_px) & (turn < share)
    shown = np.where(panel, np.float32(PANEL), dark)
    return with_lamp(shown, middle, RADIUS_PX * scale, POWER)


def _shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    dark = dimmed(judge.lit(scene).linear)
    to_px = min(judge.rig.bundle.streaks.reach_px * scene.scale, WIDEST * min(dark.shape[1:]))
    linear = _panelled(dark, value / 100, to_px, scene.scale)
    return judge.shoot(scene.showing(linear, f"{scene.name} panel {value:g}"))


SCENARIO = Scenario(
    name="streak_clipping",
    title="Streaks on clipped ground",
    knob="hidden_percent",
    unit="%",
    values=(0.0, 10.0, 25.0, 50.0, 75.0),
    nominal=0.0,
    quick=(0.0, 50.0),
    shoot=_shoot,
    applies=writes_streaks,
    rival=False,
    note="One lamp 128 times white; a panel 3 times white hides so much of the circle around it, "
    "as far as its arms reach or 0.3 of the picture's side.",
)
