"""Stars on a dark sky, brighter and brighter: what methods put around them."""

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.satellites import satellites
from camkit.report.stress.scenario import Scenario, has_room
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.report.stress.verdict import Verdict
from camkit.scenes.clean import star_field

SEED = 7_500
SKY = 1e-3
PITCH_PX = 40
"""Cells of stars: 30 px lie between two at least."""


def starry(scene: Scene, light: float) -> Scene:
    """Return lone stars in place of a scene.

    Args:
        scene: The scene.
        light: Of the brightest pixel of a star, 1 the white.
    """
    rng = np.random.default_rng(SEED + scene.number)
    height, width = scene.linear.shape[1:]
    linear = star_field(rng, (height, width), light=light, sky=SKY, pitch_px=PITCH_PX)
    return scene.showing(linear, f"stars/{light:g}/{scene.name}")


def numbers(picture: FloatArray, truth: FloatArray) -> dict[str, float]:
    """Return the satellites of a scene as a report has them."""
    found = satellites(picture, truth)
    satellite_light = {
        f"satellites_{part}_{rank}_percent": 100 * float(np.quantile(shares, share))
        for part, shares in (("above", found.above), ("below", found.below))
        for rank, share in (("median", 0.5), ("p90", 0.9))
    }
    return satellite_light | {"core_median_percent": 100 * float(np.median(found.core))}


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    return rig.record(scene, rig.light(starry(scene, value), rig.lens))


def _measure(judge: Judge, scene: Scene, value: float) -> Verdict:
    return judge.examine(_shoot(judge, scene, value), numbers)


SCENARIO = Scenario(
    name="stars",
    title="Satellites around stars",
    knob="star_light",
    unit="x white",
    values=(0.1, 0.4, 1.6, 6.4),
    nominal=1.6,
    quick=(1.6, 6.4),
    shoot=_shoot,
    measure=_measure,
    log=True,
    applies=has_room,
    note="Lone stars on a sky of 0.1 % of white. Satellites: light above, and apart light below "
    "the sky around a star, 3 to 12 px from it, in percent of the star's true light, all colours "
    "added up; median and 90th percentile over the stars. Core: the light up to 3 px. The light of "
    "the input around it is blur.",
)
