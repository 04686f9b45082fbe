"""Drift of the energy split: light that leaves the core of the PSF for a wide haze."""

import numpy as np

from camkit.contracts import FloatArray
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.light import with_kernels

HAZE_SIGMA_PX = 15.0


def add_haze(kernels: FloatArray, share: float) -> FloatArray:
    """Return (c, h, w) kernels that lose a share of their light to a Gaussian haze."""
    down, across = (
        np.exp(-0.5 * (np.arange(-(side // 2), side // 2 + 1) / HAZE_SIGMA_PX) ** 2)
        for side in kernels.shape[-2:]
    )
    haze = np.outer(down, across) / (down.sum() * across.sum())
    return np.asarray((1 - share) * kernels + share * haze, dtype=np.float32)


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    lens = with_kernels(rig.lens, lambda k: add_haze(k, value / 100)) if value else None
    return rig.shoot(scene, lens)


SCENARIO = Scenario(
    name="haze",
    title="Light lost to haze",
    knob="haze_percent",
    unit="%",
    values=(0.0, 1.0, 3.0, 6.0, 10.0, 20.0, 40.0),
    nominal=0.0,
    quick=(0.0, 10.0),
    shoot=_shoot,
    note="The haze is a Gaussian of 15 px: dust, a finger print, an aged coating.",
)
