"""Fine-tuning as the ordinary trainer runs it: files read, credits written, fitter made."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch

from camkit.colorimetry import rec709_from_camera
from camkit.contracts import RadialDistortion
from camkit.models_def.optics.distortion import trace_distortion
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.training.fine_tuning.fitter import FineTuningFitter, FineTuningParts
from camkit.models_def.training.fine_tuning.pairs import PairSamples, read_pairs
from camkit.models_def.training.fine_tuning.vgg import file_digest, read_vgg
from camkit.models_def.training.first_weights import read_first_weights
from camkit.models_def.training.fitter import Fits
from camkit.models_def.training.psf_bank import PsfBank
from camkit.models_def.training.recipe import NetworkRecipe, Recipe
from camkit.models_def.training.samples import corner_height_mm
from camkit.models_def.training.trainer import Refinement

NAME: Final = "fine_tuned"
WITHOUT_VGG: Final = (
    "no --vgg FILE: the perceptual term of eq. (6.12) compares sRGB values, not VGG-19 features"
)

Distort = Callable[[Recipe, Path], RadialDistortion | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class FineTuningOptions:
    """What fine-tuning is given.

    Attributes:
        start: Checkpoint or bundle to start from.
        size: Which network of the recipe; of a bundle with several, that of the same name.
        vgg: Weights of VGG-19; None compares sRGB values instead of features.
        pairs: Folder of real pairs.
        device: cpu or cuda.
        recipe_folder: For a lens that the recipe names by its path.
    """

    start: Path
    size: str
    vgg: Path | None = None
    pairs: Path | None = None
    device: str = "cpu"
    recipe_folder: Path = Path()


def trace_recipe_distortion(recipe: Recipe, folder: Path) -> RadialDistortion:
    """Give the distortion of a recipe's lens; the recipe lies in `folder`."""
    lens = find_lens(recipe.lens.prescription, folder)
    return trace_distortion(lens, corner_height_mm(recipe))


def make_refinement(
    recipe: Recipe, options: FineTuningOptions, *, distort: Distort = trace_recipe_distortion
) -> Refinement:
    """Prepare the fine-tuning of a recipe.

    Args:
        recipe: Its table `fine_tuning`.
        options: Files.
        distort: Gives the distortion that real pairs are aligned through; None for none.

    Raises:
        ContractError: If a file is not what it should be.
    """
    first = read_first_weights(options.start, options.size)
    features = None if options.vgg is None else read_vgg(options.vgg)
    matrix = rec709_from_camera(np.array(recipe.camera.color_matrix))

    def make_fitter(entry: NetworkRecipe, bank: PsfBank) -> Fits:
        pairs: PairSamples | None = None
        if options.pairs is not None:
            pairs = read_pairs(
                options.pairs,
                recipe,
                bank,
                distort(recipe, options.recipe_folder),
                seed=entry.schedule.seed,
            )
        parts = FineTuningParts(
            first=first,
            to_rec709=torch.from_numpy(matrix),
            features=features,
            pairs=pairs,
            device=options.device,
        )
        return FineTuningFitter(entry, recipe.fine_tuning, parts)

    return Refinement(
        name=NAME,
        schedule=recipe.fine_tuning.schedule,
        make_fitter=make_fitter,
        first=first,
        credit=_credit(options),
    )


def _credit(options: FineTuningOptions) -> str:
    """Say what else the weights learned from, for the card."""
    features = "without VGG-19"
    if options.vgg is not None:
        digest = file_digest(options.vgg)[:16]
        features = f"with VGG-19 features of {options.vgg.name} (sha256 {digest}...)"
    pairs = "" if options.pairs is None else f" and real pairs of {options.pairs.name}"
    return f"; fine-tuned against two discriminators, {features}{pairs}"
