"""Ways to take the capture of a value: through another lens, of another scene, by another setting.

Each makes a `shoot` of a scenario for cameras that photograph, from the one thing that the value
changes.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from camkit.report.stress.scenario import Measure, Shoot
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge, Numbers
from camkit.report.stress.shot import Shot
from camkit.report.stress.verdict import Verdict
from camkit.runtime.twin.exposure import Setting
from camkit.runtime.twin.haze_spread import HazeLens
from camkit.runtime.twin.light import Lens


def through_lens(change: Callable[[Lens, float], Lens]) -> Shoot:
    """Return what photographs through a changed lens; at 0 through the nominal one."""

    def shoot(judge: Judge, scene: Scene, value: float) -> Shot:
        rig = judge.rig
        return rig.shoot(scene, change(rig.lens, value) if value else None)

    return shoot


def through_haze(change: Callable[[HazeLens, float], HazeLens]) -> Shoot:
    """Return what photographs through a lens whose haze is changed by a share, given in percent."""

    def changed(lens: Lens, percent: float) -> Lens:
        assert lens.haze is not None  # such scenarios are meant for no other bundle
        return replace(lens, haze=change(lens.haze, percent / 100))

    return through_lens(changed)


def showing(show: Callable[[Scene, float], Scene], **judged: Any) -> Shoot:
    """Return what photographs another scene.

    Args:
        show: (scene, value) -> the other one, or the same where nothing changes.
        judged: Fields of the `Shot` that say how it is judged.
    """

    def shoot(judge: Judge, scene: Scene, value: float) -> Shot:
        rig, shown_scene = judge.rig, show(scene, value)
        light = rig.light(shown_scene, None if shown_scene is scene else rig.lens)
        return replace(rig.record(scene, light), **judged)

    return shoot


def set_to(setting: Callable[[float], Setting], **judged: Any) -> Shoot:
    """Return what photographs with a setting of the camera; `judged` as for `showing`."""

    def shoot(judge: Judge, scene: Scene, value: float) -> Shot:
        return replace(judge.rig.shoot(scene, setting=setting(value)), **judged)

    return shoot


def examined(shoot: Shoot, numbers: Numbers) -> Measure:
    """Return what judges a scene of its own, by numbers that belong to it."""

    def measure(judge: Judge, scene: Scene, value: float) -> Verdict:
        return judge.examine(shoot(judge, scene, value), numbers)

    return measure
