"""A snapshot HDR camera as training sees it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from torch import nn

from camkit.bundle.stages import (
    Color,
    Demosaic,
    Highlights,
    Illumination,
    Linearise,
    Network,
    Repair,
    Undistort,
    WhiteBalance,
)
from camkit.models_def.kinds.hdr.material import HdrMaterial, compute_material, read_material
from camkit.models_def.kinds.hdr.recipe import (
    CAMERA_PARTS,
    REFERENCE_ROLES,
    ROLES,
    HdrRecipe,
    reference_digest,
    samples_digest,
    to_hdr_recipe,
)
from camkit.models_def.kinds.hdr.samples import (
    DEMOSAIC,
    LAYOUT,
    HdrCamera,
    draw_corner,
    sample_of,
)
from camkit.models_def.kinds.hdr.scenes import LightSource, exposed, open_lights
from camkit.models_def.kinds.hdr.thesis.coded_samples import CodedCamera, CodedMaker, layout_of
from camkit.models_def.kinds.hdr.thesis.networks import THESIS_NAMES, build_thesis_network
from camkit.models_def.kinds.hdr.thesis.thesis_fitter import FITTING
from camkit.models_def.kinds.hdr.thesis.validation import CodedJudge, make_coded_judge
from camkit.models_def.kinds.hdr.validation import HdrJudge, make_shots
from camkit.models_def.networks.catalog import build_network, lights_px
from camkit.models_def.training.kind import Design
from camkit.models_def.training.sample import Sample, SampleLayout

FAILS_ON: Final = (
    "pictures of which a third or more clipped",
    "broad lights barely above white, whose streaks look like the scene",
    "and lights outside the picture",
)


class HdrMaker:
    """Makes sample i of a recipe."""

    def __init__(
        self, recipe: HdrRecipe, camera: HdrCamera, source: LightSource, seed: int
    ) -> None:
        self._recipe, self._camera, self._source, self._seed = recipe, camera, source, seed

    def make(self, index: int) -> Sample:
        """Photograph a scene with lights."""
        rng = np.random.default_rng((self._seed, index))
        data = self._recipe.data
        scene = self._source.draw(rng, data.capture_px + 2 * data.surround_px)
        low, high = np.log([data.saturated_min, data.saturated_max])
        share = float(np.exp(rng.uniform(low, high)))
        as_it_is = rng.random() < data.as_it_is_share
        camera = self._camera
        scene = exposed(scene, camera.matrix, camera.gains, None if as_it_is else share)
        iso = float(np.exp(rng.uniform(*np.log([data.iso_min, data.iso_max]))))
        shot = camera.photograph(scene, iso, rng, data.surround_px)
        return sample_of(shot, draw_corner(rng, shot, self._recipe), self._recipe)


class HdrTraining:
    """Fulfils `camkit.models_def.training.kind.TrainingKind`."""

    roles: Final = ROLES
    camera_parts: Final = CAMERA_PARTS

    def to_recipe(self, table: Mapping[str, Any]) -> HdrRecipe:
        """Check the tables of a recipe."""
        return to_hdr_recipe(table)

    def design(self, recipe: HdrRecipe) -> Design:
        """Return the stages of every camera of this kind."""
        return Design(
            stages=(
                Linearise(),
                Repair(),
                WhiteBalance(),
                Demosaic(method=DEMOSAIC),
                Highlights(takes=("rgb", "balanced"), method=DEMOSAIC),
                Network(
                    role=ROLES[0],
                    takes=("rgb", "lit"),
                    scale=recipe.scale,
                    lights_px=_lights_px(recipe),
                    keeps_white=True,
                ),
                Illumination(takes=("clean",)),
                Undistort(overshoot="limited"),
                Color(),
            ),
            object_distance_mm=recipe.object_distance_mm,
            fails_on=FAILS_ON,
        )

    def build_network(self, name: str, **config: Any) -> nn.Module:
        """Build a network of the catalogue, or one of the thesis."""
        if name in THESIS_NAMES:
            return build_thesis_network(name, **config)
        return build_network(name, **config)

    def layout(self, recipe: HdrRecipe, role: str) -> SampleLayout:
        """Return the layout of a role's samples: captured and lit planes in, clean planes out."""
        return layout_of(recipe, role) if role in REFERENCE_ROLES else LAYOUT

    def finish(self, recipe: HdrRecipe, role: str) -> None:
        """Return None: no stage follows a network."""
        del recipe, role

    def prepare(self, recipe: HdrRecipe, recipe_folder: Path, cache_folder: Path) -> HdrMaterial:
        """Compute the streaks of the plate."""
        return compute_material(recipe, recipe_folder, cache_folder)

    def read_material(self, folder: Path) -> HdrMaterial:
        """Read the optics that a trainer wrote."""
        return read_material(folder)

    def samples_digest(self, recipe: HdrRecipe, role: str, seed: int) -> str:
        """Hash the values that decide the samples."""
        if role in REFERENCE_ROLES:
            return reference_digest(recipe, role, seed)
        return samples_digest(recipe, seed)

    def maker(
        self,
        recipe: HdrRecipe,
        role: str,
        material: HdrMaterial,
        pictures: Path | None,
        seed: int,
    ) -> HdrMaker | CodedMaker:
        """Open the scenes."""
        source = open_lights(recipe.data, pictures)
        if role in REFERENCE_ROLES:
            return CodedMaker(recipe, role, CodedCamera(recipe, material), source, seed)
        return HdrMaker(recipe, HdrCamera(recipe, material), source, seed)

    def judge(
        self, recipe: HdrRecipe, role: str, material: HdrMaterial, pictures: Path | None
    ) -> HdrJudge | CodedJudge:
        """Photograph scenes that are never trained on."""
        if role in REFERENCE_ROLES:
            source = open_lights(recipe.data, pictures)
            return make_coded_judge(recipe, role, CodedCamera(recipe, material), source)
        shots = make_shots(recipe, HdrCamera(recipe, material), pictures)
        return HdrJudge(shots=shots, recipe=recipe)


def _lights_px(recipe: HdrRecipe) -> int | None:
    """Return the distance from lights up to which networks act; None if any acts everywhere."""
    sizes = recipe.networks.get(ROLES[0], {}).values()
    reaches_px = [px for size in sizes if (px := lights_px(size.network)) is not None]
    return max(reaches_px) if reaches_px and len(reaches_px) == len(sizes) else None


PART: Final = HdrTraining()

__all__ = ["FITTING", "PART"]
