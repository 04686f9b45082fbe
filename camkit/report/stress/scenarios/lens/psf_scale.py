"""A lens copy, refocusing or heat: all kernels a little smaller or larger than frozen."""

from camkit.report.stress.kernel_change import with_transformed
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    ratio = 1 + value / 100
    return rig.shoot(scene, with_transformed(rig.lens, ratio, 0.0) if value else None)


SCENARIO = Scenario(
    name="psf_scale",
    title="Size of the PSF",
    knob="psf_scale_percent",
    unit="%",
    values=(-20.0, -10.0, -5.0, -2.0, 0.0, 2.0, 5.0, 10.0, 20.0),
    nominal=0.0,
    quick=(-5.0, 0.0, 5.0),
    shoot=_shoot,
    note="The lens's kernels against the bundle's, its haze too where it has one.",
)
