"""Real pairs: captures and what they should have been, as samples to train on.

    aligned pair -> random places: Wiener bank, stabilised | reference warped to the capture

See `aligned_pairs` for the folder that they are read from.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.fine_tuning.aligned_pairs import NamedPair, align_pairs
from camkit.models_def.kinds.bayer.fine_tuning.alignment import Aligner
from camkit.models_def.kinds.bayer.fine_tuning.homography import Homography
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import (
    LAYOUT,
    NOT_JUDGED,
    Circumstances,
    Developed,
    finish_shot,
    layout_of,
)
from camkit.models_def.training.fitter import Mix
from camkit.models_def.training.pool import cut_patch
from camkit.models_def.training.sample import Batch, Sample, SampleLayout
from camkit.noise import NoiseModel
from camkit.radial import RadialDistortion
from camkit.units import to_mm

LEAST_JUDGED: Final = 0.5
TRIES: Final = 50

Generator = np.random.Generator


@dataclass(frozen=True, slots=True, kw_only=True)
class PairSamples:
    """Samples of real pairs, as the pool holds them.

    Attributes:
        planes: (n, c, s, s) capture and Wiener planes, and masks of the layout.
        targets: (n, 3, s, s).
        weights: (n, 3) factor to the square-root domain.
        alignments: Name of a pair -> how it was aligned.
        layout: What the planes are.
    """

    planes: NDArray[np.float16]
    targets: NDArray[np.float16]
    weights: FloatArray
    alignments: dict[str, Homography]
    layout: SampleLayout = LAYOUT

    def draw_batch(self, rng: Generator, count: int, patch_px: int) -> Batch:
        """Draw random patches of random samples, turned and flipped."""
        indices = rng.integers(len(self.planes), size=count)
        layout = self.layout
        cut = [cut_patch(rng, self.planes[i], self.targets[i], patch_px, layout) for i in indices]
        planes, targets = (
            torch.from_numpy(np.stack(patches).astype(np.float32))
            for patches in zip(*cut, strict=True)
        )
        weight = torch.from_numpy(self.weights[indices])
        return layout.batch(planes, targets, weight)

    def mixer(self, share: float, seed: int) -> Mix:
        """Return a function that replaces the first patches of a batch by patches of real pairs.

        Args:
            share: How many of them are replaced; a part of a patch is one in as many steps.
            seed: Of the draw; a step draws by itself alone, so that a resumed run draws the same.
        """

        def mix(batch: Batch, step: int) -> Batch:
            count, _, patch_px, _ = batch.target.shape
            rounds_up = np.random.default_rng((seed, 4, step)).random()
            real = int(np.floor(share * count + rounds_up))
            if real == 0:
                return batch
            real_batch = self.draw_batch(np.random.default_rng((seed, 3, step)), real, patch_px)
            return Batch(
                inputs=_replaced(batch.inputs, real_batch.inputs, real),
                target=torch.cat([real_batch.target, batch.target[real:]]),
                weight=torch.cat([real_batch.weight, batch.weight[real:]]),
                masks=_replaced(batch.masks, real_batch.masks, real),
            )

        return mix


def _replaced(
    planes: Mapping[str, Tensor], first: Mapping[str, Tensor], count: int
) -> dict[str, Tensor]:
    """Return named planes whose first patches are others."""
    return {name: torch.cat([first[name], plane[count:]]) for name, plane in planes.items()}


def read_pairs(
    folder: Path,
    recipe: BayerRecipe,
    bank: PsfBank,
    distortion: RadialDistortion | None,
    *,
    seed: int,
) -> PairSamples:
    """Align every pair of a folder and cut `fine_tuning.pair_samples` samples from each.

    Args:
        folder: See `aligned_pairs`.
        recipe: Camera, sample sizes and number.
        bank: Kernels; its frozen ones filter the captures.
        distortion: Of the lens; None for none.
        seed: Of the places.

    Raises:
        ContractError: If the folder or its settings are not as described, a capture has not the
            size of the sensor, or a pair cannot be aligned (the message names the pair).
    """
    aligner, layout = Aligner(recipe.sensor, bank, distortion), layout_of(recipe)
    samples, alignments = [], {}
    for number, one in enumerate(align_pairs(folder, recipe, aligner)):
        rng = np.random.default_rng((seed, 2, number))
        try:
            noise, depth = one.settings.noise_in(recipe), one.settings.depth_in(recipe)
            for _ in range(recipe.fine_tuning.pair_samples):
                place = _draw_place(rng, one, recipe)
                samples.append(_cut(rng, one, place, (aligner, bank, noise, depth), recipe))
        except ContractError as error:
            raise ContractError(f"pair {one.name}: {error}") from error
        alignments[one.name] = one.pair.homography
    planes = [s.stacked(layout).numpy().astype(np.float16) for s in samples]
    targets = [s.target.numpy().astype(np.float16) for s in samples]
    return PairSamples(
        planes=np.stack(planes),
        targets=np.stack(targets),
        weights=np.stack([s.weight.numpy() for s in samples]),
        alignments=alignments,
        layout=layout,
    )


def _draw_place(rng: Generator, one: NamedPair, recipe: BayerRecipe) -> tuple[int, int]:
    """Draw the first pixel (x, y) of a sample that counts at least by half."""
    margin, side = recipe.data.margin_px, recipe.data.sample_px
    height, width = one.pair.clipped.shape
    room = np.array([width, height]) - (side + 2 * margin)
    if room.min() < 0:
        raise ContractError(f"a capture must hold a sample of {side + 2 * margin} px")
    for _ in range(TRIES):
        least, most = _range_of_places(rng, one.settings.parts, side // 2 + margin, room)
        x, y = (margin + 2 * int(v) for v in rng.integers(least // 2, most // 2 + 1))
        _, counts = one.target((x, y), (side, side))
        if counts.mean() >= LEAST_JUDGED:
            return x, y
    raise ContractError(
        f"no square of {side} px was found of which half counts: the reference covers too little "
        "of the capture, is clipped, or the parts are too small"
    )


def _range_of_places(
    rng: Generator, parts: Sequence[Sequence[int]], middle: int, room: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the least and the greatest place (x, y) of samples whose middle lies in a part.

    Args:
        rng: Draws the part, by its area.
        parts: Rectangles (x0, y0, x1, y1); empty for the whole capture.
        middle: From a place to the middle of its sample.
        room: Greatest place in the capture.
    """
    if not parts:
        return np.zeros_like(room), room
    corners = np.array(parts)
    areas = (corners[:, 2:] - corners[:, :2]).prod(1)
    x0, y0, x1, y1 = corners[int(rng.choice(len(corners), p=areas / areas.sum()))]
    least, most = (np.clip(np.array(c) - middle, 0, room) for c in ((x0, y0), (x1, y1)))
    return least, most


def _cut(
    rng: Generator,
    one: NamedPair,
    place: tuple[int, int],
    setup: tuple[Aligner, PsfBank, NoiseModel, float | None],
    recipe: BayerRecipe,
) -> Sample:
    aligner, bank, noise, depth = setup
    pair, data, (x, y) = one.pair, recipe.data, place
    margin, side = data.margin_px, data.sample_px
    centre_px = np.array([place]) + (side - 1) / 2
    reach_mm = data.block_jitter_px * to_mm(recipe.sensor.pixel_pitch_um)
    block_x_mm, block_y_mm = aligner.to_sensor_mm(centre_px)[0] + rng.uniform(-1, 1, 2) * reach_mm
    illumination = float(pair.illumination(centre_px)[0])
    window = np.s_[..., y - margin : y + side + margin, x - margin : x + side + margin]
    reference, counts = one.target(place, (side, side))
    developed = Developed(
        planes=torch.from_numpy(pair.capture[window].copy())[None],
        unknown=torch.from_numpy(pair.clipped[window].copy())[None, None],
        true=torch.from_numpy(reference * np.float32(illumination)).clamp(min=0)[None],
        circumstances=Circumstances(
            noise=noise,
            gains=one.settings.gains(recipe),
            frozen=bank.frozen_kernels(float(block_x_mm), float(block_y_mm), depth),
            illumination=illumination,
            height_mm=float(np.hypot(block_x_mm, block_y_mm)),
        ),
    )
    shot = finish_shot(developed, recipe)
    target = shot.sample.target
    judged = torch.where(torch.from_numpy(counts), target, torch.tensor(NOT_JUDGED))
    return replace(shot.sample, target=judged)
