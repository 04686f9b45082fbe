"""The energy split is another: light of the peaks that lies in the haze, or the other way round."""

from dataclasses import replace

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.report.stress.scenario import Scenario, has_haze
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.haze_spread import HazeLens


def with_split(haze: HazeLens, moved: float) -> HazeLens:
    """Return a haze that holds a share of the light of the core kernels as well; the sum stays.

    Args:
        haze: What lies beside the kernels.
        moved: Share of the core's light; below 0 the core has it from the haze, as far as that
            holds so much. A place without haze has no shape to lay light in, and gets none.
    """

    def share_at(x_mm: float, y_mm: float) -> FloatArray:
        return haze.share_at(x_mm, y_mm) * np.float32(1 - moved)

    def haze_at(x_mm: float, y_mm: float) -> FloatArray:
        kernels = haze.haze_at(x_mm, y_mm)
        light = kernels.sum(axis=(1, 2))
        gained = moved * haze.share_at(x_mm, y_mm)
        factor = np.maximum(1 + gained / np.where(light > 0, light, 1), 0)
        return np.asarray(kernels * factor[:, None, None], dtype=np.float32)

    return replace(haze, haze_at=haze_at, share_at=share_at)


def taking_what_there_is(bundle: Bundle) -> Scenario:
    """Return scenario of a bundle: peaks take no more than the place with the least haze has."""
    haze = bundle.haze
    light = haze.kernels.sum(axis=(-2, -1), dtype=np.float64)
    least = -100 * float((light / haze.core_share).min())
    values = tuple(value for value in SCENARIO.values if value >= min(least, 0.0))
    quick = tuple(value for value in SCENARIO.quick if value in values)
    return replace(SCENARIO, values=values, quick=quick)


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    haze = rig.lens.haze
    assert haze is not None
    return rig.shoot(
        scene, replace(rig.lens, haze=with_split(haze, value / 100)) if value else None
    )


SCENARIO = Scenario(
    name="energy_split",
    title="Light between peak and haze",
    knob="moved_percent",
    unit="%",
    values=(-60.0, -40.0, -20.0, -10.0, -5.0, -2.0, 0.0, 2.0, 5.0, 10.0, 20.0, 40.0, 60.0, 80.0),
    nominal=0.0,
    quick=(-10.0, 0.0, 10.0),
    shoot=_shoot,
    applies=has_haze,
    fit=taking_what_there_is,
    note="So much of the peaks' light lies in the haze: walls of grooves that lean, dust. Below 0 "
    "the peaks hold more than the bundle says. Kernels keep their shapes.",
)
