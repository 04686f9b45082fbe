"""Invented detail: gratings finer and finer, and how much contrast each method gives them."""

from dataclasses import replace

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge, see
from camkit.report.stress.shot import Shot
from camkit.report.stress.verdict import Verdict

MOST_MTF = 1.1
"""Contrast above the scene's own is invented."""
MEAN, CONTRAST = 0.4, 0.6
BORDER_PX = 64


def grating(scene: Scene, cycles_per_px: float) -> Scene:
    """Return a grey sine grating in place of a scene."""
    height, width = scene.linear.shape[1:]
    angle = np.pi * (scene.number % 8) / 8
    y, x = np.mgrid[:height, :width]
    phase = 2 * np.pi * cycles_per_px / scene.scale * (np.cos(angle) * x + np.sin(angle) * y)
    wave = (MEAN * (1 + CONTRAST * np.sin(phase))).astype(np.float32)
    return scene.showing(np.stack([wave] * 3), f"grating/{cycles_per_px:g}/{scene.name}")


def modulation(plane: FloatArray, truth: FloatArray) -> float:
    """Return the contrast of a picture at the frequencies of the truth, 1 for all of it."""
    inner = np.s_[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    got, true = (p[inner].astype(np.float64) for p in (plane, truth))
    got, true = got - got.mean(), true - true.mean()
    return float((got * true).sum() / np.square(true).sum())


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    return rig.record(scene, rig.light(grating(scene, value), rig.lens))


def _measure(judge: Judge, scene: Scene, value: float) -> Verdict:
    rig, shot = judge.rig, _shoot(judge, scene, value)
    restored = rig.restore(shot)
    outcomes = judge.judge(shot, restored, with_chi2=False)
    for method, planes in restored.planes.items():
        middle = len(planes) // 2
        mtf = modulation(planes[middle], shot.light.clean[middle])
        fault = f"MTF {mtf:.2f}: contrast that is not in the scene" if mtf > MOST_MTF else None
        outcomes[method] = replace(
            outcomes[method], fault=outcomes[method].fault or fault, extra={"mtf": mtf}
        )
    return Verdict(outcomes=outcomes, seen=see(rig, shot))


SCENARIO = Scenario(
    name="resolution",
    title="Invented detail: gratings",
    knob="cycles_per_px",
    unit="cycles/px",
    values=(0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4),
    nominal=0.05,
    quick=(0.05, 0.2),
    shoot=_shoot,
    measure=_measure,
    rival=False,
    note="Sine gratings, one direction per scene. MTF above 1.1 is invented contrast and a break, "
    "nothing else is: chi^2 is not calibrated for pictures that are all aliasing; "
    "near 0.5 cycles/px the colour mosaic aliases whatever the method.",
)
