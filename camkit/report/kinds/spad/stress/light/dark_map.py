"""Dark counts that differ from pixel to pixel; their map is known and taken off."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario

SPREAD: Final = 1.0
"""Of the logarithm of dark counts."""


def dark_map(shape: tuple[int, int], mean: float, seed: int) -> NDArray[np.float64]:
    """Return dark counts (h, w), log-normal from pixel to pixel."""
    chance = np.random.default_rng(seed)
    return mean * chance.lognormal(-(SPREAD**2) / 2, SPREAD, shape)


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    dark = dark_map(judge.studio.shape, value, scene.number)
    return judge.shoot(scene, PictureSetting(dark=dark), with_chi2=True)


SCENARIO = Scenario(
    name="dark_map",
    title="Dark counts, map known",
    knob="dark counts of a pixel",
    unit="",
    values=(0.0, 10.0, 100.0, 1000.0, 10000.0, 30000.0, 100000.0, 1000000.0),
    nominal=0.0,
    quick=(0.0, 1000.0, 100000.0),
    shoot=_shoot,
    applies=makes_finer,
    log=True,
    note=f"10,000 photons of white; a log-normal map of spread 1. {OF_PICTURES}",
)
