"""Samples of a recipe in its circumstances, to judge restorations on.

recipe -> lens, frames, scenes -> samples by the bank or by a classical method -> PSNR, SSIM, look
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from camkit.colorimetry import rec709_from_camera
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.frames.samples import TileMaker
from camkit.models_def.kinds.bayer.samples import NOT_JUDGED
from camkit.models_def.training.adversarial.content import Features, gram_loss
from camkit.models_def.training.adversarial.views import Views, make_views
from camkit.models_def.training.kind import Restorer, SampleMaker, read_recipe, training_kind
from camkit.models_def.training.losses import ssim
from camkit.models_def.training.sample import Sample, SampleLayout
from camkit.psf import depth_name
from tools.tables.losses.classical import with_method

METRICS: Final = ("psnr_db", "ssim", "perceptual")
LEAST_ERROR: Final = 1e-12
SEED: Final = 909
"""Of the samples."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Domain:
    """Samples to judge on.

    Attributes:
        samples: Never trained on.
        frames: Number of the frame that a sample is of; of its own where it is cut from none.
        distances_mm: How far off their scenes are; empty where nobody says.
        layout: Of them.
        to_rec709: (3, 3) white-balanced camera colours to linear Rec.709.
    """

    samples: Sequence[Sample]
    frames: Sequence[int]
    distances_mm: Sequence[float]
    layout: SampleLayout
    to_rec709: Tensor

    def score(self, restore: Restorer, features: Features) -> dict[str, Any]:
        """Measure a restoration by `METRICS`: means over the samples, and `each` by its frame.

        Where scenes are at several distances, `at` has the mean PSNR at every one.
        """
        scores = [
            (
                _psnr_db(views),
                float(ssim(views.fake, views.real)),
                float(gram_loss(features(views.fake), features(views.real))),
            )
            for views in self._views(restore)
        ]
        each = dict(zip(METRICS, np.transpose(scores).tolist(), strict=True))
        means = {name: float(np.mean(values)) for name, values in each.items()}
        decibels, places_mm = np.array(each["psnr_db"]), np.array(self.distances_mm)
        at = {
            depth_name(far_mm): float(np.mean(decibels[places_mm == far_mm]))
            for far_mm in np.unique(places_mm)
        }
        return {**means, "each": each, "frames": list(self.frames), **({"at": at} if at else {})}

    def _views(self, restore: Restorer) -> Iterator[Views]:
        for sample in self.samples:
            planes = sample.stacked(self.layout)[None]
            output, truth = restore(planes), judged_target(sample.target[None], planes)
            yield make_views(output, truth, sample.weight[None], self.to_rec709)


def _psnr_db(views: Views) -> float:
    error = max(float((views.fake - views.real).square().mean()), LEAST_ERROR)
    return -10 * float(np.log10(error))


def as_filtered(planes: Tensor) -> Tensor:
    """Return what the bank, or the method in its place, makes of samples, (n, 3, S, S)."""
    return planes[:, -3:]


def judged_target(target: Tensor, planes: Tensor) -> Tensor:
    """Return target less what it has from the bank, which is asked for where light was clipped."""
    return torch.where(target == as_filtered(planes), torch.tensor(NOT_JUDGED), target)


@lru_cache(maxsize=2)
def domain(
    recipe_path: Path,
    folder: Path,
    pictures: Path | None,
    count: int,
    method: str | None = None,
) -> Domain:
    """Make the samples of a recipe: trace its lens, or take the frames that lie in the folder.

    Args:
        recipe_path: Of the recipe.
        folder: Of its frames and traced kernels; made if it is not there.
        pictures: Scenes.
        count: Number of samples.
        method: Classical, in place of the bank.

    Raises:
        ContractError: If the sensor has no colours to see pictures in.
    """
    recipe = read_recipe(recipe_path)
    kind, role = training_kind(recipe.kind), recipe.role(None)
    matrix = getattr(recipe.sensor, "color_matrix", None)
    if matrix is None:
        raise ContractError(f"{recipe_path} has no sensor.color_matrix, to see pictures")
    folder.mkdir(parents=True, exist_ok=True)
    material = kind.prepare(recipe, recipe_path.parent, folder)
    maker: SampleMaker = kind.maker(recipe, role, material, pictures, SEED)
    frames, distances_mm = list(range(count)), []
    if isinstance(maker, TileMaker):
        frames = [maker.frame_of(number) for number in range(count)]
        known_mm = [maker.distance_mm(number) for number in range(count)]
        distances_mm = [far_mm for far_mm in known_mm if far_mm is not None]
    if method is not None:
        maker = with_method(method, maker, recipe)
    return Domain(
        samples=[maker.make(number) for number in range(count)],
        frames=frames,
        distances_mm=distances_mm,
        layout=kind.layout(recipe, role),
        to_rec709=torch.from_numpy(rec709_from_camera(np.array(matrix))).float(),
    )
