"""A lens copy, refocusing or heat: all kernels a little smaller or larger than frozen."""

from dataclasses import replace
from typing import Final

from camkit.bundle.reader import Bundle
from camkit.report.stress.kernel_change import with_transformed
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot

FAR_PERCENT: Final = (30.0, 40.0)
"""To both sides, for optics with a haze: their peaks are smaller than what else is wrong."""


def reaching_far(bundle: Bundle) -> Scenario:
    """Return the scenario of a bundle, with larger changes where it has a haze."""
    if not bundle.manifest.has_haze:
        return SCENARIO
    smaller = tuple(-value for value in reversed(FAR_PERCENT))
    return replace(SCENARIO, values=(*smaller, *SCENARIO.values, *FAR_PERCENT))


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
    fit=reaching_far,
    note="The lens's kernels against the bundle's, its haze too where it has one.",
)
