"""Scenes with lights: nights, and pictures into which the lights of a night are put."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.models_def.training.pictures import SceneSource, open_scenes
from camkit.models_def.training.recipe import SceneRecipe
from camkit.runtime.kinds.hdr.night import night_scene
from camkit.scenes.saturation import CEILING, saturating_exposure

NIGHT_SEED: Final = 5_000_000
"""Of training; scenes to measure on are night:0 and upwards."""
DUSK_EV: Final = (-3.0, -0.5)
"""How far pictures are darkened, in stops."""

Generator = np.random.Generator


@dataclass(frozen=True, slots=True, kw_only=True)
class LightSource:
    """Draws scenes.

    Attributes:
        source: Of pictures, and of procedural scenes where there are none.
        picture_share: Share of scenes that are pictures.
    """

    source: SceneSource
    picture_share: float

    def draw(self, rng: Generator, side_px: int) -> FloatArray:
        """Return a scene (3, side, side) linear Rec.709, lights above 1."""
        night = night_scene(NIGHT_SEED + int(rng.integers(2**31)), side_px, side_px)
        if rng.random() >= self.picture_share:
            return night
        picture = self.source.draw_crop(rng, side_px)
        dusk = np.float32(2.0 ** rng.uniform(*DUSK_EV))
        return np.where((night > 1).any(axis=0), night, picture * dusk).astype(np.float32)


def open_lights(data: SceneRecipe, pictures: Path | None) -> LightSource:
    """Open a source of scenes with lights; without a folder of nights alone."""
    return LightSource(
        source=open_scenes(data, pictures, picture_share=1.0),
        picture_share=data.picture_share if pictures is not None else 0.0,
    )


def exposed(
    scene: FloatArray,
    matrix: NDArray[np.float64],
    gains: tuple[float, float, float],
    share: float | None,
) -> FloatArray:
    """Return a scene exposed so that a share of it saturates, up to 2^8 times white.

    Args:
        scene: (3, h, w) linear Rec.709.
        matrix: To white-balanced camera space.
        gains: White balance.
        share: Of its pixels; None for the scene as it is. So is one that saturates no such share.
    """
    factor = 1.0
    if share is not None:
        try:
            factor = saturating_exposure(scene, matrix, gains, share).exposure
        except ContractError:
            factor = 1.0
    return np.asarray(np.minimum(scene * np.float32(factor), CEILING), np.float32)
