"""The material for samples of a snapshot HDR camera: the streaks of its plate."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import psf_of_streaks
from camkit.bundle.streak_file import read_streaks, streaks_to_bytes, write_streaks
from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.optics.diffraction.plate import plate_members, read_plate
from camkit.models_def.optics.diffraction.plate_streaks import plate_streaks
from camkit.runtime.bank.psf import wavelength_weights
from camkit.streaks import StreakOptics

FILE: Final = "streaks.safetensors"


@dataclass(frozen=True, slots=True, kw_only=True)
class HdrMaterial:
    """Streak optics, and the plate that they were computed of.

    Attributes:
        streaks: Of the plate.
        designed: The plate as a bundle holds it; empty for streaks that are of none.
    """

    streaks: StreakOptics
    designed: Mapping[str, bytes] = field(default_factory=dict)

    def digest(self) -> str:
        """Return the sha256 of the optics."""
        return hashlib.sha256(streaks_to_bytes(self.streaks)).hexdigest()

    def write(self, folder: Path) -> None:
        """Write the optics for another process."""
        write_streaks(folder / FILE, self.streaks)

    def color_kernels(self, recipe: HdrRecipe, *, bare: bool = False) -> FloatArray:
        """Return the dense kernels (3, n, n) of the sensor's colours, each of sum 1."""
        psf = psf_of_streaks(self.streaks, 3, bare=bare)
        weights = wavelength_weights(psf.wavelengths_um, *recipe.sensor.response_arrays())
        kernels = np.einsum("cw,wyx->cyx", weights, psf.kernels[0, -1])
        return np.asarray(kernels, np.float32)


def read_material(folder: Path) -> HdrMaterial:
    """Read a file of `HdrMaterial.write`: samples need no more than the streaks."""
    return HdrMaterial(streaks=read_streaks(folder / FILE))


def compute_material(recipe: HdrRecipe, recipe_folder: Path, cache_folder: Path) -> HdrMaterial:
    """Compute the streaks of a recipe's plate (seconds), or read an earlier result.

    Raises:
        ContractError: If there is no such plate, or it writes no streaks.
    """
    del cache_folder
    beside_recipe = recipe_folder / recipe.plate.file
    plate = read_plate(beside_recipe if beside_recipe.is_file() else Path(recipe.plate.file))
    streaks = plate_streaks(plate, recipe.sensor, side_px=recipe.plate.side_px)
    return HdrMaterial(streaks=streaks, designed=plate_members(plate))
