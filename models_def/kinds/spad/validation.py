"""Fixed photographs of pictures that are never trained on, at several levels of light."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.models_def.kinds.spad.evaluation import bicubic, psnr_db
from camkit.models_def.kinds.spad.recipe import PLATE, SpadRecipe
from camkit.models_def.kinds.spad.samples import draw_luminance, photograph
from camkit.models_def.kinds.spad.sampling import Sampling
from camkit.models_def.networks.bicubic import SCALE
from camkit.models_def.training.kind import Restorer, Score, mean_score
from camkit.models_def.training.pictures import SceneSource, open_scenes

CROPS: Final = 8
CROP_PX: Final = 192
"""Sub-pixels."""
LEVELS: Final = 3
SEED: Final = 505


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Photograph:
    """A picture and what is known of it.

    Attributes:
        photons: Of white.
        planes: (1, c, h, w), what a network is given.
        light: (1, 1, h, w) as counted, for the interpolation it must beat.
        fine: (1, 1, 4 h, 4 w), the truth.
    """

    photons: float
    planes: Tensor
    light: Tensor
    fine: Tensor


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpadJudge:
    """Judges by fixed photographs.

    Attributes:
        shots: At every level.
        sampling: With which they were taken.
    """

    shots: Sequence[Photograph]
    sampling: Sampling

    def baselines(self) -> Mapping[str, float]:
        """Return the mean dB of bicubic interpolation."""
        finer = bicubic(self.sampling)
        return {"bicubic": self._mean([finer(shot.light) for shot in self.shots]).mean_db}

    def score(self, restore: Restorer) -> Score:
        """Compute the mean PSNR of a restoration in dB, by photons."""
        with torch.no_grad():
            return self._mean([restore(shot.planes) for shot in self.shots])

    def _mean(self, pictures: Sequence[Tensor]) -> Score:
        pairs = zip(self.shots, pictures, strict=True)
        every = [psnr_db(picture.clamp(0, 1), shot.fine) for shot, picture in pairs]
        return mean_score(every, by_photons=[f"{shot.photons:.0f}" for shot in self.shots])


def make_judge(
    recipe: SpadRecipe, role: str, sampling: Sampling, pictures: Path | None
) -> SpadJudge:
    """Photograph crops at the ends and in the middle of the trained range of light."""
    data = recipe.data
    source = open_scenes(data, pictures, picture_share=1.0)
    levels = np.unique(np.geomspace(data.photons_min, data.photons_max, LEVELS).round(3))
    shots = [
        _take(recipe, role, sampling, source, (number, float(level)))
        for level in levels
        for number in range(CROPS)
    ]
    return SpadJudge(shots=shots, sampling=sampling)


def _take(
    recipe: SpadRecipe,
    role: str,
    sampling: Sampling,
    source: SceneSource,
    which: tuple[int, float],
) -> Photograph:
    number, photons = which
    rng = np.random.default_rng((SEED, number))
    fine = draw_luminance(source, rng, CROP_PX // SCALE * SCALE)
    exposure = recipe.data.exposure(photons)
    light_and_noise = photograph(fine, sampling, exposure, rng)
    planes = light_and_noise if recipe.data.told else light_and_noise[:, :1]
    if role == PLATE:
        deviation = torch.full_like(fine, 1 / np.sqrt(exposure.white_counts))
        planes = torch.cat([fine, deviation], dim=1)
    return Photograph(photons=photons, planes=planes, light=light_and_noise[:, :1], fine=fine)
