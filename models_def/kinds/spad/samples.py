"""One training sample: a picture seen by the array, counted, and the picture itself.

upscale  crop of luminance -> kernel, phase -> Poisson -> light and its noise | the crop
plate    the crop and 1 / sqrt(N), for a network that has a plate of its own  | the crop
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.bundle.facts import Port
from camkit.colorimetry import encode_srgb, luma
from camkit.models_def.kinds.spad.counting import Exposure, expose
from camkit.models_def.kinds.spad.recipe import PLATE, SpadRecipe
from camkit.models_def.kinds.spad.sampling import HALF, Sampling
from camkit.models_def.networks.bicubic import SCALE
from camkit.models_def.training.pictures import SceneSource
from camkit.models_def.training.sample import Sample, SampleLayout

MARGIN_PX: Final = -(-HALF // SCALE)
"""Pixels of surroundings that a kernel sees."""

Generator = np.random.Generator


def layout_of(recipe: SpadRecipe, role: str) -> SampleLayout:
    """Return the layout of a role's samples."""
    if role == PLATE:
        return SampleLayout(
            inputs=(Port(name="sharp", channels=1), Port(name="deviation", channels=1)),
            outputs=(Port(name="fine", channels=1),),
        )
    noise = (Port(name="noise", channels=1),) if recipe.data.told else ()
    # the phase is not in the middle of a pixel, so what is turned is another camera's sample
    return SampleLayout(
        inputs=(Port(name="light", channels=1), *noise),
        outputs=(Port(name="fine", channels=1, scale=SCALE),),
        turned=False,
    )


def draw_luminance(source: SceneSource, rng: Generator, side_px: int) -> Tensor:
    """Cut a crop (1, 1, side, side) of L, turned and mirrored at random."""
    crop = luma(encode_srgb(source.draw_crop(rng, side_px)))
    turned = np.rot90(crop, int(rng.integers(4)))
    if rng.random() < 0.5:
        turned = turned[:, ::-1]
    return torch.from_numpy(np.ascontiguousarray(turned))[None, None]


def photograph(fine: Tensor, sampling: Sampling, exposure: Exposure, rng: Generator) -> Tensor:
    """Return light and noise (1, 2, h, w) of a picture (1, 1, 4 h, 4 w).

    The exposure is that of one sub-pixel: a pixel that collects more counts more.
    """
    # rounding may leave a hair below 0
    light = sampling.see(fine).clamp(min=0)
    return expose(light, exposure.brighter(sampling.light), rng)


class SpadMaker:
    """Makes sample i of a recipe."""

    def __init__(
        self, recipe: SpadRecipe, role: str, sampling: Sampling, source: SceneSource, seed: int
    ) -> None:
        self._recipe, self._role, self._seed = recipe, role, seed
        self._sampling, self._source = sampling, source

    def make(self, index: int) -> Sample:
        """Photograph a crop."""
        rng = np.random.default_rng((self._seed, index))
        data = self._recipe.data
        low, high = np.log([data.photons_min, data.photons_max])
        photons = float(np.exp(rng.uniform(low, high)))
        if self._role == PLATE:
            sharp = draw_luminance(self._source, rng, data.sample_px)[0]
            deviation = torch.full_like(sharp, 1 / np.sqrt(data.exposure(photons).white_counts))
            return _sample({"sharp": sharp, "deviation": deviation}, sharp)
        side = SCALE * (data.sample_px + 2 * MARGIN_PX)
        wide = draw_luminance(self._source, rng, side)
        planes = photograph(wide, self._sampling, data.exposure(photons), rng)
        inner = slice(MARGIN_PX, MARGIN_PX + data.sample_px)
        middle = planes[0, :, inner, inner]
        fine = slice(SCALE * inner.start, SCALE * inner.stop)
        inputs = {"light": middle[:1]} | ({"noise": middle[1:]} if data.told else {})
        return _sample(inputs, wide[0, :, fine, fine])


def _sample(inputs: Mapping[str, Tensor], target: Tensor) -> Sample:
    return Sample(inputs=inputs, target=target, weight=torch.ones(1))
