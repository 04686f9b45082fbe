"""Unseen surroundings: what lies beside the picture throws more light into it, or less."""

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import WHITE, Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting, signal_of
from camkit.runtime.twin.light import Lens

MOST_RING_PX = 512
"""Farther away the surroundings go on as the mirror image of their ring, then of the picture."""


def ring_px(lens: Lens) -> int:
    """Return how far a lens throws light, as far as it is asked for."""
    haze = lens.haze
    reach_px = lens.margin_px if haze is None else haze.reach_cells * haze.cell_px
    return int(np.clip(reach_px, 1, MOST_RING_PX))


def surrounded(scene: Scene, reach_px: int, factor: float) -> FloatArray:
    """Return a scene amid its mirror image, which is so many times as bright.

    Args:
        scene: What is in the picture.
        reach_px: Of the surroundings, in pixels of the sensor.
        factor: On their light.
    """
    ring = scene.scale * reach_px
    around = np.pad(scene.linear, ((0, 0), (ring, ring), (ring, ring)), mode="reflect")
    around *= np.float32(factor)
    around[:, ring:-ring, ring:-ring] = scene.linear
    return around


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    if value == 0:
        return rig.shoot(scene)
    light = rig.light_amid(scene, surrounded(scene, ring_px(rig.lens), 2.0**value))
    brightest = float(signal_of(light, rig.sensor).max())
    return rig.record(scene, light, Setting(exposure=min(WHITE / max(brightest, WHITE), 1.0)))


SCENARIO = Scenario(
    name="surroundings",
    title="Brightness beside the picture",
    knob="surroundings_ev",
    unit="EV",
    values=(-6.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0),
    nominal=0.0,
    quick=(-2.0, 0.0, 2.0),
    shoot=_shoot,
    note="What lies beside the picture is its mirror image, as methods think, but for this factor "
    "on its light, as far as kernels and haze reach and up to 512 px. Exposed so that nothing "
    "clips.",
)
