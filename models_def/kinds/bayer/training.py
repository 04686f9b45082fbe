"""A camera for photographs as training sees it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from torch import nn

from camkit.bundle.chain import rewired
from camkit.bundle.stages import (
    Color,
    Demosaic,
    Illumination,
    Linearise,
    Network,
    RaiseClipped,
    Repair,
    Stage,
    Undistort,
    WhiteBalance,
)
from camkit.models_def.kinds.bayer.frames.samples import TileMaker, validation_captures
from camkit.models_def.kinds.bayer.material import BayerMaterial, read_material, trace_material
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.recipe import (
    CAMERA_PARTS,
    ROLES,
    BayerRecipe,
    samples_digest,
    to_bayer_recipe,
)
from camkit.models_def.kinds.bayer.samples import (
    Developed,
    draw_exposure,
    finish_of,
    finish_shot,
    layout_of,
    photograph,
    scene_side_px,
    tint_crop,
)
from camkit.models_def.kinds.bayer.validation import BayerJudge, make_validation_captures
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.training.kind import Design, SampleMaker
from camkit.models_def.training.pictures import open_scenes
from camkit.models_def.training.sample import Finish, Sample, SampleLayout

FAILS_ON: Final = (
    "sources that clip over more than the PSF",
    "light of a narrow band",
    "and lenses off by more than the fabrication errors it was trained with (radius 0.2 %, "
    "thickness 0.03 mm, index 0.0005, focus 0.02 mm)",
)

FAILS_BEYOND_MEASUREMENT: Final = "and lenses whose PSF is off by more than its uncertainty"
FAILS_BEHIND_HAZE: Final = "lamps that clip: they throw more haze than the sensor tells"


class BayerMaker:
    """Makes sample i of a recipe."""

    def __init__(
        self, recipe: BayerRecipe, bank: PsfBank, pictures: Path | None, seed: int
    ) -> None:
        self._recipe, self._bank, self._seed = recipe, bank, seed
        self._source = open_scenes(recipe.data, pictures, drawn_shares=recipe.data.drawn_shares)

    def developed(self, index: int) -> Developed:
        """Photograph a crop of a scene, and develop it."""
        rng = np.random.default_rng((self._seed, index))
        exposure = draw_exposure(rng, self._recipe, self._bank)
        crop = self._source.draw_crop(rng, scene_side_px(self._recipe, self._bank))
        light, truth = self._recipe.data.lit(rng, tint_crop(rng, crop))
        return photograph(light, exposure, self._recipe, self._bank, rng, truth)

    def make(self, index: int) -> Sample:
        """Photograph a crop of a scene."""
        return finish_shot(self.developed(index), self._recipe).sample


class BayerTraining:
    """Fulfils `camkit.models_def.training.kind.TrainingKind`."""

    roles: Final = ROLES
    camera_parts: Final = CAMERA_PARTS

    def to_recipe(self, table: Mapping[str, Any]) -> BayerRecipe:
        """Check the tables of a recipe."""
        return to_bayer_recipe(table)

    def design(self, recipe: BayerRecipe) -> Design:
        """Return the stages of every camera of this kind, with the recipe's bank."""
        # what the runtime does, every reader of the bundle can do: docs/guides/portable.md
        wiener = recipe.wiener.model_copy(update={"whole_blocks": True})
        picture = wiener.takes[0]
        if recipe.haze is not None:
            (picture,) = recipe.haze.gives
            wiener = wiener.model_copy(update={"takes": (picture, *wiener.takes[1:])})
        masks = () if recipe.light is None else wiener.takes[1:]
        network = Network(
            takes=(picture, *wiener.gives, *masks), scale=recipe.scale, light=recipe.light
        )
        hazy = () if recipe.haze is None else (recipe.haze,)
        restoring: tuple[Stage, ...] = (*hazy, wiener, network)
        usual = (
            Linearise(),
            Repair(),
            WhiteBalance(),
            Demosaic(method="fast"),
            *restoring,
            RaiseClipped(),
            Illumination(),
            Undistort(interpolation="cubic", overshoot="limited", places="fixed"),
            Color(),
        )
        absent = _without_meaning(recipe)
        return Design(
            stages=rewired([stage for stage in usual if not isinstance(stage, absent)], usual)
            if absent
            else usual,
            object_distance_mm=recipe.object_distance_mm,
            fails_on=_fails_on(recipe),
        )

    def build_network(self, name: str, **config: Any) -> nn.Module:
        """Build a network of the catalogue."""
        return build_network(name, **config)

    def layout(self, recipe: BayerRecipe, role: str) -> SampleLayout:
        """Return the layout: capture and Wiener planes in, clean planes out."""
        del role
        return layout_of(recipe)

    def finish(self, recipe: BayerRecipe, role: str) -> Finish | None:
        """Return the stage that removes light that a network may not move."""
        del role
        return finish_of(recipe)

    def prepare(
        self, recipe: BayerRecipe, recipe_folder: Path, cache_folder: Path
    ) -> BayerMaterial:
        """Trace the lens and its copies, or read its measured PSF and draw some."""
        return trace_material(recipe, recipe_folder, cache_folder)

    def read_material(self, folder: Path) -> BayerMaterial:
        """Read the kernels that a trainer wrote."""
        return read_material(folder)

    def samples_digest(self, recipe: BayerRecipe, role: str, seed: int) -> str:
        """Hash the values that decide the samples."""
        del role
        return samples_digest(recipe, seed)

    def maker(
        self,
        recipe: BayerRecipe,
        role: str,
        material: BayerMaterial,
        pictures: Path | None,
        seed: int,
    ) -> SampleMaker:
        """Open the scenes."""
        del role
        if material.frames is not None:
            tiles = material.frames.tiles("train", pictures)
            return TileMaker(recipe, material.bank, tiles, seed)
        return BayerMaker(recipe, material.bank, pictures, seed)

    def judge(
        self, recipe: BayerRecipe, role: str, material: BayerMaterial, pictures: Path | None
    ) -> BayerJudge:
        """Photograph pictures that are never trained on."""
        del role
        if material.frames is not None:
            tiles = material.frames.tiles("valid", pictures)
            captures = validation_captures(recipe, material.bank, tiles)
        else:
            captures = make_validation_captures(recipe, material.bank, pictures)
        return BayerJudge(captures=captures, recipe=recipe)


def _without_meaning(recipe: BayerRecipe) -> tuple[type[Stage], ...]:
    """Return the stages that mean nothing to a sensor of planes."""
    if recipe.sensor.cfa is not None:
        return ()
    is_grey = len(recipe.sensor.channels) == 1
    return (Demosaic, WhiteBalance, RaiseClipped) if is_grey else (Demosaic,)


def _fails_on(recipe: BayerRecipe) -> tuple[str, ...]:
    if recipe.lens.psf:
        return (*FAILS_ON[:-1], FAILS_BEYOND_MEASUREMENT)
    return FAILS_ON if recipe.haze is None else (*FAILS_ON, FAILS_BEHIND_HAZE)


PART: Final = BayerTraining()
