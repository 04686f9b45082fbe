"""An even disc on black, as the moon: what methods do to its limb."""

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.limb import limb_errors
from camkit.report.stress.scenario import Scenario, has_room
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.report.stress.verdict import Verdict
from camkit.scenes.clean import Disc, disc_on_black

SEED = 7_600
SKY = 1e-3
RADIUS_SHARE = 0.3
"""Of the shorter side of a scene."""


def moonlit(scene: Scene, light: float) -> Scene:
    """Return a disc on black in place of a scene.

    Args:
        scene: The scene.
        light: Of the disc, 1 the white.
    """
    rng = np.random.default_rng(SEED + scene.number)
    height, width = scene.linear.shape[1:]
    y, x = (float(side / 2 + rng.uniform(-4, 4)) for side in (height, width))
    disc = Disc(center_px=(y, x), radius_px=RADIUS_SHARE * min(height, width) + rng.uniform(-4, 4))
    linear = disc_on_black(rng, (height, width), disc, light=light, sky=SKY)
    return scene.showing(linear, f"limb/{light:g}/{scene.name}")


def numbers(picture: FloatArray, truth: FloatArray) -> dict[str, float]:
    """Return what is wrong with a limb as a report has it."""
    found = limb_errors(picture, truth)
    return {
        "wobble_px": found.wobble_px,
        "seam_percent": 100 * found.seam,
        "rim_percent": 100 * found.rim,
    }


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    return rig.record(scene, rig.light(moonlit(scene, value), rig.lens))


def _measure(judge: Judge, scene: Scene, value: float) -> Verdict:
    return judge.examine(_shoot(judge, scene, value), numbers)


SCENARIO = Scenario(
    name="limb",
    title="Limb of a disc on black",
    knob="disc_light",
    unit="x white",
    values=(0.05, 0.2, 0.6),
    nominal=0.6,
    quick=(0.05, 0.6),
    shoot=_shoot,
    measure=_measure,
    log=True,
    applies=has_room,
    note="A disc on a sky of 0.1 % of white. Wobble: standard deviation along the limb of where "
    "the picture falls through half of the step, in waves of at most 48 px, the truth's own taken "
    "off. Light must fall all the way out; seam and rim: how far it rises again outside and inside "
    "of the limb, in percent of the step, mean of 16 sectors and of the colours.",
)
