"""NaN and infinities in a float capture: one of them must not turn a picture black."""

from dataclasses import replace

import numpy as np

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.twin import Setting, Shot, photograph


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    shot = photograph(rig.light(scene), rig.bundle.manifest.camera, Setting())
    rng = np.random.default_rng(7_300 + scene.number)
    samples = shot.capture.samples.astype(np.float32)
    chance = rng.random(samples.shape)
    spoiled = chance < value / 100
    samples[spoiled] = np.nan
    samples[chance < value / 200] = np.inf
    samples[chance < value / 400] = -np.inf
    capture = replace(shot.capture, samples=samples)
    return replace(shot, capture=capture, spoiled=spoiled if value else None)


SCENARIO = Scenario(
    name="invalid_pixels",
    title="NaN and infinite pixels",
    knob="invalid_percent",
    unit="%",
    values=(0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0),
    nominal=0.0,
    quick=(0.0, 1.0),
    shoot=_shoot,
    log=True,
    bounds={"broken_fraction": "high"},
    note="Half NaN, a quarter each of the infinities, in a float mosaic.",
)
