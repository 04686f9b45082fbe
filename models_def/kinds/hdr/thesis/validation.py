"""Fixed samples that are never trained on, and the linear PSNR by which a role is judged."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.kinds.hdr.samples import draw_corner
from camkit.models_def.kinds.hdr.scenes import LightSource, exposed
from camkit.models_def.kinds.hdr.thesis.coded_samples import CodedCamera, coded_sample, layout_of
from camkit.models_def.kinds.hdr.thesis.networks import to_light
from camkit.models_def.kinds.hdr.validation import ISOS, MOST_DB, SEED
from camkit.models_def.training.kind import Restorer, Score, mean_score
from camkit.scenes.saturation import CEILING

SAMPLES: Final = 6
SHARE: Final = 0.015


def _with_no_streaks(roots: Tensor) -> Tensor:
    return torch.cat([roots.clamp(max=1), torch.zeros_like(roots)], dim=1)


def _pasted(roots: Tensor) -> Tensor:
    return torch.maximum(*torch.split(roots, 3, dim=1))


BASELINES: Final[Mapping[str, tuple[str, Callable[[Tensor], Tensor]]]] = {
    "split": ("capture", _with_no_streaks),
    "highlight": ("white", torch.ones_like),
    "fusion": ("pasted", _pasted),
    "whole": ("capture", torch.Tensor.contiguous),
}
"""Role -> what it must beat: the name and how it is made of the roots that a network is given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CodedJudge:
    """Judges one role.

    Attributes:
        role: Of the networks.
        samples: (ISO, inputs (1, c, s, s), truth (1, k, s, s)), roots.
    """

    role: str
    samples: Sequence[tuple[float, Tensor, Tensor]]

    def baselines(self) -> Mapping[str, float]:
        """Return the mean dB of the baselines."""
        name, make = BASELINES[self.role]
        return {name: self.score(make).mean_db}

    def score(self, restore: Restorer) -> Score:
        """Compute the mean PSNR in dB, by ISO; the peak is 1 for layers, 2^8 with lights."""
        peak = 1.0 if self.role == "split" else CEILING
        every = []
        with torch.no_grad():
            for _, planes, truth in self.samples:
                gap = to_light(restore(planes)).clamp(max=peak) - to_light(truth).clamp(max=peak)
                mean = max(float(gap.double().square().mean()), 1e-30)
                every.append(min(float(10 * np.log10(peak**2 / mean)), MOST_DB))
        return mean_score(every, by_iso=[f"{iso:g}" for iso, *_ in self.samples])


def make_coded_judge(
    recipe: HdrRecipe, role: str, camera: CodedCamera, source: LightSource
) -> CodedJudge:
    """Photograph scenes, cut to a sample about a light each; in the order of their ISOs."""
    samples, layout, data = [], layout_of(recipe, role), recipe.data
    for number in range(SAMPLES):
        rng = np.random.default_rng((SEED, number))
        scene = source.draw(rng, data.capture_px + 2 * data.surround_px)
        scene = exposed(scene, camera.matrix, camera.gains, SHARE)
        iso = ISOS[number % len(ISOS)]
        shot = camera.photograph(scene, iso, rng)
        sample = coded_sample(shot, draw_corner(rng, shot, recipe), recipe, role)
        samples.append((iso, sample.stacked(layout)[None], sample.target[None]))
    return CodedJudge(role=role, samples=tuple(sorted(samples, key=lambda sample: sample[0])))
