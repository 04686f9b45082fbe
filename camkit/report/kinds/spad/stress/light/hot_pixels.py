"""Hot pixels that are stated, and painted over."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PHOTONS, PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario

HOT_COUNTS: Final = 5 * PHOTONS


def hot_mask(shape: tuple[int, int], share: float, seed: int) -> NDArray[np.bool_]:
    """Return pixels (h, w) drawn at random; those of a smaller share are among them."""
    return np.asarray(np.random.default_rng(seed).random(shape) < share)


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    hot = hot_mask(judge.studio.shape, value, scene.number)
    return judge.shoot(scene, PictureSetting(hot=hot, hot_counts=HOT_COUNTS), with_chi2=True)


SCENARIO = Scenario(
    name="hot_pixels",
    title="Hot pixels, known",
    knob="share of pixels",
    unit="",
    values=(0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.2, 0.4),
    nominal=0.0,
    quick=(0.0, 0.01, 0.1),
    shoot=_shoot,
    applies=makes_finer,
    note=f"They count five times what white does. {OF_PICTURES}",
)
