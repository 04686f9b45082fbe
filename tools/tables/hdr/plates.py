"""The cameras of the tables: the plate of a row before the lens and the sensor of `streak-hdr`.

Every plate is a camera by core, arms and haze, in training and measuring alike, so that a row is
read back with the light that it was photographed with. Of `dual-peak` that form misplaces 2.2 % of
the light (`camkit freeze` keeps it as kernels therefore): its row is one of a plate that is so much
blurred. The bare lens is a camera of a core alone: its solve reads the rings of the aperture.
"""

from dataclasses import replace
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Final, cast

import numpy as np

from camkit.bundle.chain import rewired
from camkit.bundle.frozen_optics import FrozenOptics, psf_of_streaks
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network
from camkit.bundle.streak_file import write_streaks
from camkit.bundle.writer import write_physics
from camkit.models_def.kinds.hdr.material import HdrMaterial, compute_material
from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.training.kind import read_recipe, training_kind
from camkit.streaks import StreakOptics

BARE: Final = "bare-lens"
CROSS: Final = "streak-cross"
OURS: Final = "streak_hdr.toml"
RECIPES: Final = Path(str(resources.files("camkit.models_def.recipes")))


@lru_cache
def material_of(plate: str) -> HdrMaterial:
    """Compute what a built-in plate writes (ten seconds); the bare lens is that of any."""
    recipe = shipped_recipe()
    plate_choice = replace(recipe.plate, file=CROSS if plate == BARE else plate)
    material = compute_material(replace(recipe, plate=plate_choice), RECIPES, RECIPES)
    return HdrMaterial(streaks=core_alone(material.streaks)) if plate == BARE else material


def core_alone(streaks: StreakOptics) -> StreakOptics:
    """Return the lens without its plate as optics whose arms and haze hold no light."""
    shortest = streaks.bare_core.shape[-1] // 2 + 2
    return replace(
        streaks,
        core=streaks.bare_core,
        profiles=np.zeros_like(streaks.profiles[..., :shortest]),
        haze=np.zeros_like(streaks.haze[..., :1, :1]),
    )


def write_camera(folder: Path, plate: str) -> tuple[Path, Bundle]:
    """Write the optics of a camera, for export, and its bundle without a network.

    Returns:
        The file of the optics, and the bundle.
    """
    material, recipe = material_of(plate), shipped_recipe()
    frozen = folder / f"{plate}.safetensors"
    write_streaks(frozen, material.streaks)
    optics = FrozenOptics(psf=psf_of_streaks(material.streaks, 3), streaks=material.streaks)
    design = training_kind(recipe.kind).design(recipe)
    physics = [stage for stage in design.stages if not isinstance(stage, Network)]
    stages = rewired(physics, design.stages)
    path, names = folder / f"{plate}.camkit", {"kind": recipe.kind, "name": plate}
    distance_mm = design.object_distance_mm
    return frozen, write_physics(path, stages, recipe.sensor, optics, distance_mm, **names)


@lru_cache
def shipped_recipe() -> HdrRecipe:
    """Return the recipe whose lens and sensor all cameras of the tables have."""
    return cast("HdrRecipe", read_recipe(RECIPES / OURS))
