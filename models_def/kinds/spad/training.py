"""A single-photon camera as training sees it."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from torch import nn

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.stages import Correct, Stage, SuperResolve
from camkit.errors import UnsupportedError
from camkit.models_def.kinds.spad.fitter import FITTING
from camkit.models_def.kinds.spad.networks import build_spad_network
from camkit.models_def.kinds.spad.plate_psf import frozen_psf, read_plate_psf, write_plate_psf
from camkit.models_def.kinds.spad.recipe import (
    CAMERA_PARTS,
    ROLES,
    SpadRecipe,
    samples_digest,
    to_spad_recipe,
)
from camkit.models_def.kinds.spad.samples import SpadMaker, layout_of
from camkit.models_def.kinds.spad.sampling import Sampling, make_sampling
from camkit.models_def.kinds.spad.validation import SpadJudge, make_judge
from camkit.models_def.training.kind import Design
from camkit.models_def.training.pictures import open_scenes
from camkit.models_def.training.sample import SampleLayout

PSF_FILE: Final = "psf.safetensors"
DEPTH: Final = "depth_m"
FAILS_ON: Final = (
    "fewer than 100 to 200 photons a pixel (the bare array is better there)",
    "a plate turned by several degrees",
    "another fill factor or phase of the samples",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpadMaterial:
    """The kernel that light goes through.

    Attributes:
        kernel: (11, 11), a point where there is no plate.
        designed: Nothing: a plate is made from its kernel.
    """

    kernel: FloatArray
    designed: Mapping[str, bytes] = field(default_factory=dict)

    def digest(self) -> str:
        """Return the sha256 of the kernel."""
        return hashlib.sha256(psf_to_bytes(frozen_psf(self.kernel))).hexdigest()

    def write(self, folder: Path) -> None:
        """Write the kernel for another process."""
        write_plate_psf(folder / PSF_FILE, self.kernel)


class SpadTraining:
    """Fulfils `camkit.models_def.training.kind.TrainingKind`."""

    roles: Final = ROLES
    camera_parts: Final = CAMERA_PARTS

    def to_recipe(self, table: Mapping[str, Any]) -> SpadRecipe:
        """Check the tables of a recipe."""
        return to_spad_recipe(table)

    def design(self, recipe: SpadRecipe) -> Design:
        """Return the stages: photons, the fine grid, and depth where there are time bins.

        Raises:
            UnsupportedError: If its networks are not told the noise of pixels, as the stage does.
        """
        if not recipe.data.told:
            raise UnsupportedError(
                f"no bundle can be made of {recipe.name}: a bundle tells its networks the noise "
                "of every pixel; train them with data.told"
            )
        stages: tuple[Stage, ...] = (Correct(), SuperResolve())
        products = {IMAGE: stages[-1].gives[0]}
        if recipe.sensor.time_bins:
            stages = (*stages, recipe.times)
            products[DEPTH] = stages[-1].gives[0]
        return Design(stages=stages, products=products, fails_on=FAILS_ON)

    def build_network(self, name: str, **config: Any) -> nn.Module:
        """Build a network of this kind."""
        return build_spad_network(name, **config)

    def layout(self, recipe: SpadRecipe, role: str) -> SampleLayout:
        """Return the layout: light and its noise in, a picture four times as fine out."""
        return layout_of(recipe, role)

    def finish(self, recipe: SpadRecipe, role: str) -> None:
        """Return None: no stage follows a network."""
        del recipe, role

    def prepare(self, recipe: SpadRecipe, recipe_folder: Path, cache_folder: Path) -> SpadMaterial:
        """Read or make the kernel."""
        del cache_folder
        plan = recipe.sampling
        learned = None if plan.psf is None else read_plate_psf(recipe_folder / plan.psf)
        sampling = make_sampling(
            plan.mode, kernel=learned, sigma=plan.sigma, phase=recipe.sensor.phase
        )
        return SpadMaterial(kernel=sampling.kernel)

    def read_material(self, folder: Path) -> SpadMaterial:
        """Read the kernel that a trainer wrote."""
        return SpadMaterial(kernel=read_plate_psf(folder / PSF_FILE))

    def samples_digest(self, recipe: SpadRecipe, role: str, seed: int) -> str:
        """Hash the values that decide the samples."""
        return samples_digest(recipe, role, seed)

    def maker(
        self,
        recipe: SpadRecipe,
        role: str,
        material: SpadMaterial,
        pictures: Path | None,
        seed: int,
    ) -> SpadMaker:
        """Open the scenes."""
        source = open_scenes(recipe.data, pictures)
        return SpadMaker(recipe, role, sampling_of(recipe, material), source, seed)

    def judge(
        self, recipe: SpadRecipe, role: str, material: SpadMaterial, pictures: Path | None
    ) -> SpadJudge:
        """Photograph pictures that are never trained on."""
        return make_judge(recipe, role, sampling_of(recipe, material), pictures)


def sampling_of(recipe: SpadRecipe, material: SpadMaterial) -> Sampling:
    """Return the sampling by the array of a recipe, with the kernel of its material."""
    plan = recipe.sampling
    return Sampling(
        mode=plan.mode,  # type: ignore[arg-type]
        kernel=material.kernel,
        phase=recipe.sensor.phase,
    )


PART: Final = SpadTraining()

__all__ = ["FITTING", "PART"]
