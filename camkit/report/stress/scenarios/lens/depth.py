"""Objects at every depth that the bundle knows; the bank has their mean kernel."""

from dataclasses import replace

from camkit.bundle.reader import Bundle
from camkit.report.stress.scenario import Scenario, photographs
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.units import MM_PER_M

FAR_M = 1000.0
"""Stands for infinity, which no chart can show."""


def _applies(bundle: Bundle) -> str | None:
    if not bundle.manifest.has_kernels or bundle.psf.depths_mm.size < 2:
        return "its PSF knows no several depths"
    return photographs(bundle)


def depths_of(bundle: Bundle) -> Scenario:
    """Return the scenario with the depths of a bundle; nominal is the one nearest to its focus."""
    depths_mm = bundle.psf.depths_mm.tolist()
    values = tuple(sorted({min(depth_mm / MM_PER_M, FAR_M) for depth_mm in depths_mm}))
    focus_m = bundle.reference_depth_mm / MM_PER_M
    nominal = min(values, key=lambda depth_m: abs(1 / depth_m - 1 / focus_m))
    quick = tuple(sorted({values[0], nominal, values[-1]}))
    return replace(SCENARIO, values=values, nominal=nominal, quick=quick)


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    return rig.shoot(scene, rig.lens_at(value * MM_PER_M))


SCENARIO = Scenario(
    name="depth",
    title="Depth of the scene",
    knob="depth_m",
    unit="m",
    values=(0.5, 0.7, 1.0, 1.5),
    nominal=1.0,
    quick=(0.5, 1.0, 1.5),
    shoot=_shoot,
    applies=_applies,
    fit=depths_of,
    log=True,
    note="The whole scene lies at one depth, which the methods are not told. The depths are those "
    "of the bundle; 1000 m stands for infinity.",
)
