"""A haze that was measured without its dark frame: black that the bundle takes for light."""

from dataclasses import replace

from camkit.contracts import FloatArray
from camkit.haze import without_pedestal
from camkit.report.stress.scenario import Scenario, has_haze
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.haze_spread import HazeLens


def black_taken_off(haze: HazeLens, share: float) -> HazeLens:
    """Return the haze that optics really have where a bundle's stands on a pedestal.

    Args:
        haze: As the bundle has it.
        share: Of a point's light that is black, see `without_pedestal`.
    """

    def haze_at(x_mm: float, y_mm: float) -> FloatArray:
        return without_pedestal(haze.haze_at(x_mm, y_mm), haze.share_at(x_mm, y_mm), share)

    return replace(haze, haze_at=haze_at)


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    haze = rig.lens.haze
    assert haze is not None
    lens = replace(rig.lens, haze=black_taken_off(haze, value / 100)) if value else None
    return rig.shoot(scene, lens)


SCENARIO = Scenario(
    name="lost_dark_frame",
    title="Haze measured without its dark frame",
    knob="pedestal_percent",
    unit="%",
    values=(0.0, 1.0, 3.0, 6.0, 12.0, 30.0, 60.0),
    nominal=0.0,
    quick=(0.0, 12.0),
    shoot=_shoot,
    applies=has_haze,
    note="So much of a point's light in the bundle is black level, even over the cells of its "
    "haze; the optics do not have it. 0.1 DN are 12 to 60 % of a point below white.",
)
