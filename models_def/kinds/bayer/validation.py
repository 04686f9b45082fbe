"""Validation: fixed captures of pictures that are never trained on, judged on sRGB values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.colorimetry import apply_matrix, encode_srgb
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import (
    Exposure,
    Shot,
    corner_height_mm,
    finish_of,
    layout_of,
    make_shot,
    scene_side_px,
    told_depth,
)
from camkit.models_def.sensors.stabilise import unstabilise
from camkit.models_def.training.kind import Restorer, Score, mean_score
from camkit.models_def.training.pictures import SCENE_SEED, list_pictures, read_picture, to_linear
from camkit.progress import counted
from camkit.runtime.twin.light import camera_space
from camkit.scenes import procedural_scene

FIELD_SHARES: Final = (0.0, 0.3, 0.55, 0.8, 0.98)
ISOS: Final = (100.0, 1600.0)
GOLDEN_ANGLE_RAD: Final = 2.399963
BLOCK_OFFSET_PX: Final = 90.0
PROCEDURAL_PICTURES: Final = 8
SEED: Final = 424242


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationCapture:
    """One capture: its shot, the (3, s, s) sharp sRGB picture, where and by which copy."""

    shot: Shot
    sharp: FloatArray
    field_share: float
    iso: float
    copy: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class BayerJudge:
    """Judges by fixed captures.

    Attributes:
        captures: From `make_validation_captures`.
        recipe: Camera and scale.
    """

    captures: Sequence[ValidationCapture]
    recipe: BayerRecipe

    def baselines(self) -> Mapping[str, float]:
        """Return the mean dB of the capture as it is, and of the Wiener bank alone."""
        return {
            "capture": self.score(lambda planes: planes[:, :3]).mean_db,
            "wiener": self.score(lambda planes: planes[:, 3:]).mean_db,
        }

    def score(self, restore: Restorer) -> Score:
        """Compute the mean PSNR of a restoration in dB on sRGB values, by ISO and field height."""
        return score(self.captures, self.recipe, restore)


def make_validation_captures(
    recipe: BayerRecipe, bank: PsfBank, pictures: Path | None
) -> list[ValidationCapture]:
    """Photograph the middle of each picture at five field heights, two ISOs, the depths in turn.

    The lens is one of the copies that are not trained on, in turn; each Wiener block lies off its
    place as a block of the bank does. Without a folder, procedural scenes are photographed.
    """
    side = scene_side_px(recipe, bank)
    captures = []
    crops = _crops(pictures, side)
    for number, crop in enumerate(counted(crops, "photographing", "pictures")):
        for spot, share in enumerate(FIELD_SHARES):
            for iso in ISOS:
                rng = np.random.default_rng((SEED, number, spot, int(iso)))
                exposure = _exposure(recipe, bank, share, iso, number * len(FIELD_SHARES) + spot)
                light, truth = recipe.data.lit(rng, crop)
                shot = make_shot(light, exposure, recipe, bank, rng, truth)
                inner = (side - recipe.data.sample_px) // 2
                sharp = encode_srgb(truth[:, inner : side - inner, inner : side - inner])
                captures.append(
                    ValidationCapture(
                        shot=shot,
                        sharp=sharp,
                        field_share=share,
                        iso=iso,
                        copy=(exposure.copy - bank.training_copies) // bank.depths,
                    )
                )
    return captures


def _crops(pictures: Path | None, side: int) -> list[FloatArray]:
    if pictures is None:
        seeds = range(SCENE_SEED - PROCEDURAL_PICTURES, SCENE_SEED)
        return [procedural_scene(seed, side, side) for seed in seeds]
    return [to_linear(_middle(read_picture(p), side)) for p in list_pictures(pictures)]


def _middle(picture: NDArray[np.uint8], side: int) -> NDArray[np.uint8]:
    height, width, _ = picture.shape
    missing = (max(0, side - height), max(0, side - width), 0)
    picture = np.pad(picture, [(m // 2, m - m // 2) for m in missing], mode="symmetric")
    top, left = (picture.shape[0] - side) // 2, (picture.shape[1] - side) // 2
    return picture[top : top + side, left : left + side]


def _exposure(recipe: BayerRecipe, bank: PsfBank, share: float, iso: float, turn: int) -> Exposure:
    height = share * corner_height_mm(recipe)
    number = sum(divmod(turn, len(FIELD_SHARES)))
    depth, validation_copy = number % bank.depths, number // bank.depths % bank.validation_copies
    azimuth = turn * GOLDEN_ANGLE_RAD
    x_mm, y_mm = height * np.cos(azimuth), height * np.sin(azimuth)
    offset = BLOCK_OFFSET_PX * recipe.sensor.pixel_pitch_um / 1000
    copy = bank.training_copies + validation_copy * bank.depths + depth
    error = recipe.data.depth_error * (1 - 2 * (turn % 2))
    return Exposure(
        x_mm=float(x_mm),
        y_mm=float(y_mm),
        block_x_mm=float(x_mm + offset * np.cos(3 * azimuth)),
        block_y_mm=float(y_mm + offset * np.sin(3 * azimuth)),
        copy=copy,
        iso=iso,
        filter_depth=told_depth(recipe, copy, error) if recipe.estimates_depth else None,
    )


def score(captures: Sequence[ValidationCapture], recipe: BayerRecipe, restore: Restorer) -> Score:
    """Compute the scores of a restoration.

    Args:
        captures: From `make_validation_captures`.
        recipe: Camera and scale.
        restore: (1, 6, s, s) stabilised planes -> (1, 3, s, s) stabilised.

    Returns:
        Mean PSNR on sRGB values; by ISO, by field height as a share of the corner's, and by copy
        of the lens where there are several.
    """
    values = every_db(captures, recipe, restore)
    labels = {
        "by_iso": [f"{capture.iso:g}" for capture in captures],
        "by_field": [f"{capture.field_share:g}" for capture in captures],
    }
    copies = [f"{capture.copy}" for capture in captures]
    if len(set(copies)) > 1:
        labels["by_copy"] = copies
    return mean_score(values, **labels)


def every_db(
    captures: Sequence[ValidationCapture], recipe: BayerRecipe, restore: Restorer
) -> list[float]:
    """Return the PSNR of each capture on sRGB values; arguments as of `score`."""
    with torch.no_grad():
        return [_psnr(c, recipe, _restored(c, recipe, restore)) for c in captures]


def _restored(capture: ValidationCapture, recipe: BayerRecipe, restore: Restorer) -> Tensor:
    """Return (3, s, s) stabilised planes as the runtime has them."""
    sample, layout, finish = capture.shot.sample, layout_of(recipe), finish_of(recipe)
    batch = layout.batch(sample.stacked(layout)[None], sample.target[None], sample.weight[None])
    restored = restore(batch.planes)
    return restored[0] if finish is None else finish(restored, batch)[0]


def to_srgb(stable: Tensor, capture: ValidationCapture, recipe: BayerRecipe) -> FloatArray:
    """Convert stabilised (3, s, s) planes to sRGB values, vignetting divided out."""
    noise = capture.shot.noise
    shot, read = torch.tensor(noise.shot), torch.tensor(noise.read_variance)
    linear = unstabilise(stable[None].float(), shot, read, scale=recipe.scale)[0]
    matrix, _ = camera_space(recipe.sensor)
    even: FloatArray = (linear / capture.shot.illumination).numpy()
    to_rec709 = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    return encode_srgb(apply_matrix(to_rec709, even))


def _psnr(capture: ValidationCapture, recipe: BayerRecipe, stable: Tensor) -> float:
    gap = to_srgb(stable, capture, recipe) - capture.sharp
    return float(-10 * np.log10(np.mean(np.square(gap, dtype=np.float64)) + 1e-12))
