"""Fixed captures of scenes that are never trained on, judged by linear PSNR at 2^8 times white."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch

from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.kinds.hdr.samples import HdrCamera, Shot, sample_of
from camkit.models_def.kinds.hdr.scenes import exposed, open_lights
from camkit.models_def.sensors.stabilise import unstabilise
from camkit.models_def.training.kind import Restorer, Score, mean_score
from camkit.scenes.saturation import CEILING

CAPTURES: Final = 10
SEED: Final = 313131
ISOS: Final = (100.0, 800.0)
SHARES: Final = (0.006, 0.015, 0.015, 0.03)
MOST_DB: Final = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HdrJudge:
    """Judges by fixed captures.

    Attributes:
        shots: (ISO, shot).
        recipe: Camera and scale.
    """

    shots: Sequence[tuple[float, Shot]]
    recipe: HdrRecipe

    def baselines(self) -> Mapping[str, float]:
        """Return the mean dB of the capture, and of the lights by physics alone."""
        return {
            "capture": self.score(lambda planes: planes[:, :3]).mean_db,
            "physics": self.score(lambda planes: planes[:, 3:]).mean_db,
        }

    def score(self, restore: Restorer) -> Score:
        """Return the mean PSNR of a restoration in dB, by ISO."""
        with torch.no_grad():
            every = [_psnr_db(shot, restore, self.recipe) for _, shot in self.shots]
        return mean_score(every, by_iso=[f"{iso:g}" for iso, _ in self.shots])


def make_shots(
    recipe: HdrRecipe, camera: HdrCamera, pictures: Path | None
) -> tuple[tuple[float, Shot], ...]:
    """Photograph scenes; the shots are in the order of their ISOs."""
    data = recipe.data
    source = open_lights(data, pictures)
    shots = []
    for number in range(CAPTURES):
        rng = np.random.default_rng((SEED, number))
        scene = source.draw(rng, data.capture_px + 2 * data.surround_px)
        share = SHARES[number % len(SHARES)]
        scene = exposed(scene, camera.matrix, camera.gains, share)
        iso = ISOS[number % len(ISOS)]
        shots.append((iso, camera.photograph(scene, iso, rng, data.surround_px)))
    return tuple(sorted(shots, key=lambda pair: pair[0]))


def _psnr_db(shot: Shot, restore: Restorer, recipe: HdrRecipe) -> float:
    whole = sample_of(shot, (0, 0), recipe, side_px=shot.clipped.shape[0])
    planes = torch.cat([whole.inputs["rgb"], whole.inputs["lit"]])[None]
    shots, reads = torch.tensor(shot.noise.shot), torch.tensor(shot.noise.read_variance)
    light = unstabilise(restore(planes), shots, reads, scale=recipe.scale)[0].numpy()
    gap = np.clip(light, 0, CEILING) - np.minimum(shot.sharp, CEILING)
    mean = float(np.mean(np.square(gap, dtype=np.float64)))
    return min(float(10 * np.log10(CEILING**2 / max(mean, 1e-30))), MOST_DB)
