"""Scenes and light as no training shows them: what was learned must hold outside the laboratory."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.report.stress.lamps import DAYLIGHT_K, tint
from camkit.report.stress.scenario import row
from camkit.report.stress.scene import WHITE, Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.report.stress.taking import showing
from camkit.runtime.twin.exposure import Setting, signal_of
from camkit.runtime.twin.light import Lens

MOST_RING_PX: Final = 512
"""Farther away the surroundings go on as the mirror image of their ring, then of the picture."""


def sunlit(scene: Scene, ratio: float) -> FloatArray:
    """Return a scene (3, h, w) one half of which is lit so many times as strongly.

    The edge of the shade runs through the middle, in a direction that the scene's number decides.
    """
    height, width = scene.linear.shape[1:]
    angle = np.pi * (scene.number % 8 + 0.5) / 4
    y, x = np.mgrid[:height, :width].astype(np.float32)
    distance_px = np.cos(angle) * (x - (width - 1) / 2) + np.sin(angle) * (y - (height - 1) / 2)
    sun = np.clip(distance_px + 0.5, 0, 1)
    return np.asarray(scene.linear * (1 + (ratio - 1) * sun), dtype=np.float32)


def _sun_and_shade(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    if value == 1:
        return rig.shoot(scene)
    lit = scene.showing(sunlit(scene, value), f"{scene.name} sun {value:g}")
    return rig.record(scene, rig.light(lit, rig.lens), Setting(exposure=1 / value))


def _tinted(scene: Scene, kelvin: float) -> Scene:
    if kelvin == DAYLIGHT_K:
        return scene
    tinted = scene.linear * tint(kelvin).astype(np.float32)[:, None, None]
    return scene.showing(tinted, f"{scene.name} {kelvin:g} K")


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
    canvas = np.pad(scene.linear, ((0, 0), (ring, ring), (ring, ring)), mode="reflect")
    canvas *= np.float32(factor)
    canvas[:, ring:-ring, ring:-ring] = scene.linear
    return canvas


def _amid(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    if value == 0:
        return rig.shoot(scene)
    light = rig.light_amid(scene, surrounded(scene, ring_px(rig.lens), 2.0**value))
    brightest = float(signal_of(light, rig.sensor).max())
    return rig.record(scene, light, Setting(exposure=min(WHITE / max(brightest, WHITE), 1.0)))


SCENARIOS: Final = (
    row(
        *("dynamic_range", "Range of the light: sun and shade", "range_factor", "x"),
        "[1] 4 8 (16) 32 64",
        shoot=_sun_and_shade,
        log=True,
        note="Half of the scene is lit so many times as strongly. The exposure is for the sun, so "
        "that nothing clips; pictures are judged at the brightness of the shade, the sun ends at "
        "white.",
    ),
    row(
        *("light_colour", "Colour of the light", "temperature_k", "K"),
        f"(2500) 3200 4000 5000 [{DAYLIGHT_K:g}] 8000 (10000)",
        shoot=showing(_tinted),
        log=True,
        note="The scene's colours are multiplied by those of a black body, the brightest channel "
        "as before; white balance and kernels stay those of daylight, and the truth is tinted as "
        "well.",
    ),
    row(
        *("surroundings", "Brightness beside the picture", "surroundings_ev", "EV"),
        "-6 (-2) -1 [0] 1 (2) 4",
        shoot=_amid,
        note="What lies beside the picture is its mirror image, as methods think, but for this "
        "factor on its light, as far as kernels and haze reach and up to 512 px. Exposed so that "
        "nothing clips.",
    ),
)
