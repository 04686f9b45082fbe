"""Tiles through the bank: what is trained on, and what a run is chosen by."""

import numpy as np
import torch

from camkit.colorimetry import apply_matrix, camera_from_rec709, encode_srgb
from camkit.models_def.kinds.bayer.frames.tiles import Tile, Tiles
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import (
    Circumstances,
    Developed,
    corner_height_mm,
    finish_shot,
)
from camkit.models_def.kinds.bayer.validation import (
    BLOCK_OFFSET_PX,
    FIELD_SHARES,
    GOLDEN_ANGLE_RAD,
    ValidationCapture,
)
from camkit.models_def.training.sample import Sample
from camkit.units import to_mm

Generator = np.random.Generator


def developed(
    tile: Tile, recipe: BayerRecipe, bank: PsfBank, offset_mm: tuple[float, float] = (0.0, 0.0)
) -> Developed:
    """Return a tile as the input of the bank.

    Args:
        tile: A tile.
        recipe: Of the camera.
        bank: Its core kernels.
        offset_mm: From the tile to the middle of its block, whose kernel the bank takes.
    """
    _, gains = camera_from_rec709(np.array(recipe.sensor.color_matrix))
    x_mm, y_mm = tile.x_mm + offset_mm[0], tile.y_mm + offset_mm[1]
    return Developed(
        planes=torch.from_numpy(tile.planes)[None],
        unknown=torch.from_numpy(tile.clipped)[None, None],
        true=torch.from_numpy(tile.sharp)[None],
        circumstances=Circumstances(
            noise=recipe.sensor.noise_at(tile.iso).with_gains(gains),
            noise_rise=tile.noise_rise,
            gains=gains,
            frozen=bank.frozen_kernels(x_mm, y_mm),
            illumination=float(bank.illumination_at(tile.x_mm, tile.y_mm)),
            height_mm=float(np.hypot(x_mm, y_mm)),
        ),
    )


def draw_developed(rng: Generator, tile: Tile, recipe: BayerRecipe, bank: PsfBank) -> Developed:
    """Return a tile as the input of a block beside it."""
    most_mm = recipe.data.block_jitter_px * to_mm(recipe.sensor.pixel_pitch_um)
    x_mm, y_mm = (float(v) for v in rng.uniform(-most_mm, most_mm, 2))
    return developed(tile, recipe, bank, (x_mm, y_mm))


class TileMaker:
    """Makes sample i of the tiles: each once, in an order of its own, then all again."""

    def __init__(self, recipe: BayerRecipe, bank: PsfBank, tiles: Tiles, seed: int) -> None:
        self._recipe, self._bank, self._tiles, self._seed = recipe, bank, tiles, seed

    def developed(self, index: int) -> Developed:
        """Return a tile as the input of the bank."""
        rng = np.random.default_rng((self._seed, 1, index))
        tile = self._tiles.read(self._tile_of(index))
        return draw_developed(rng, tile, self._recipe, self._bank)

    def frame_of(self, index: int) -> int:
        """Return the number of the frame that a sample is cut from."""
        return self._tile_of(index) // (self._recipe.frames.shots * self._recipe.frames.tiles)

    def distance_mm(self, index: int) -> float | None:
        """Return the distance of a sample's scene; None where it is not stated."""
        copy = self._tiles.facts("copy")[self._tile_of(index)]
        return self._recipe.lens.distance_of(int(copy))

    def _tile_of(self, index: int) -> int:
        turn, place = divmod(index, len(self._tiles))
        order = np.random.default_rng((self._seed, 0, turn)).permutation(len(self._tiles))
        return int(order[place])

    def make(self, index: int) -> Sample:
        """Restore a tile by the bank."""
        return finish_shot(self.developed(index), self._recipe).sample


def validation_captures(
    recipe: BayerRecipe, bank: PsfBank, tiles: Tiles
) -> list[ValidationCapture]:
    """Restore tiles that are never trained on, blocks off them as in a bank."""
    matrix, _ = camera_from_rec709(np.array(recipe.sensor.color_matrix))
    to_rec709 = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    corner_mm = corner_height_mm(recipe)
    off_mm = BLOCK_OFFSET_PX * to_mm(recipe.sensor.pixel_pitch_um)
    captures = []
    for index in range(len(tiles)):
        tile, angle = tiles.read(index), index * GOLDEN_ANGLE_RAD
        offset = float(off_mm * np.cos(angle)), float(off_mm * np.sin(angle))
        shot = finish_shot(developed(tile, recipe, bank, offset), recipe)
        share = float(np.hypot(tile.x_mm, tile.y_mm)) / corner_mm
        captures.append(
            ValidationCapture(
                shot=shot,
                sharp=encode_srgb(apply_matrix(to_rec709, tile.sharp / shot.illumination)),
                field_share=min(FIELD_SHARES, key=lambda field: abs(field - share)),
                iso=tile.iso,
                copy=tile.copy - bank.training_copies,
            )
        )
    return captures
