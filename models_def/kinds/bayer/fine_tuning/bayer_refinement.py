"""Fine-tuning as the ordinary trainer runs it: files read, credits written, fitter made."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
import torch

from camkit.models_def.kinds.bayer.fine_tuning.pairs import read_pairs
from camkit.models_def.kinds.bayer.material import BayerMaterial
from camkit.models_def.kinds.bayer.recipe import BayerRecipe, FineTuningRecipe
from camkit.models_def.kinds.bayer.samples import corner_height_mm
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.networks.vgg import file_digest
from camkit.models_def.optics.distortion import trace_distortion
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.measured import find_measured
from camkit.models_def.training.adversarial.content import Conv33, Features
from camkit.models_def.training.adversarial.opponents import OpponentPlan
from camkit.models_def.training.adversarial.picture_fitter import PictureParts, picture_fitter
from camkit.models_def.training.adversarial.relativistic import Relativistic
from camkit.models_def.training.first_weights import read_first_weights
from camkit.models_def.training.fitter import BETAS, Fitter, Mix
from camkit.models_def.training.recipe import ContentRecipe, NetworkRecipe
from camkit.models_def.training.refinement import FineTuningOptions, Refinement
from camkit.radial import RadialDistortion
from camkit.runtime.twin.light import camera_space

NAME: Final = "fine_tuned"
OPPONENT_SEED: Final = 2
Distort = Callable[[BayerRecipe, Path], RadialDistortion | None]


def trace_recipe_distortion(recipe: BayerRecipe, folder: Path) -> RadialDistortion:
    """Return the distortion of a recipe's lens or PSF; the recipe lies in `folder`."""
    if recipe.lens.psf:
        return find_measured(recipe.lens.psf, folder).distortion(corner_height_mm(recipe), 3)
    lens = find_lens(recipe.lens.prescription, folder)
    return trace_distortion(lens, corner_height_mm(recipe))


def make_refinement(
    recipe: BayerRecipe, options: FineTuningOptions, *, distort: Distort = trace_recipe_distortion
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
    # without VGG-19 the sRGB values themselves are compared
    features: Features = torch.Tensor.contiguous if options.vgg is None else Conv33(options.vgg)
    matrix = np.linalg.inv(camera_space(recipe.sensor)[0])

    def make_fitter(entry: NetworkRecipe, material: BayerMaterial) -> Fitter:
        mix: Mix | None = None
        if options.pairs is not None:
            seed, distortion = entry.schedule.seed, distort(recipe, options.recipe_folder)
            pairs = read_pairs(options.pairs, recipe, material.bank, distortion, seed=seed)
            mix = pairs.mixer(recipe.fine_tuning.pair_share, seed)
        tuning = recipe.fine_tuning
        parts = PictureParts(
            content=ContentRecipe(
                l1_weight=tuning.pixel_weight, feature_weight=tuning.perceptual_weight
            ),
            to_rec709=torch.from_numpy(matrix),
            features=features,
            opponents=discriminators(tuning, entry.schedule.seed),
            mix=mix,
            first=first,
            device=options.device,
        )
        return picture_fitter(entry, build_network, parts)

    return Refinement(
        name=NAME,
        schedule=recipe.fine_tuning.schedule,
        make_fitter=make_fitter,
        first=first,
        credit=_credit(options),
    )


def discriminators(recipe: FineTuningRecipe, seed: int) -> OpponentPlan:
    """Return the global and the local discriminator of a recipe. References: eq. (6.14)."""
    return OpponentPlan(
        game=Relativistic(),
        weights={"global": recipe.global_weight, "local": recipe.local_weight},
        layers={"global": recipe.global_layers, "local": recipe.local_layers},
        width=recipe.discriminator_width,
        learning_rate=recipe.discriminator_rate,
        beta1=BETAS[0],
        steps=1,
        seed=seed + OPPONENT_SEED,
    )


def _credit(options: FineTuningOptions) -> str:
    """Return the further training data of the weights, for the card."""
    features = "without VGG-19"
    if options.vgg is not None:
        digest = file_digest(options.vgg)[:16]
        features = f"with VGG-19 features of {options.vgg.name} (sha256 {digest}...)"
    pairs = "" if options.pairs is None else f" and real pairs of {options.pairs.name}"
    return f"; fine-tuned against two discriminators, {features}{pairs}"


class BayerRefining:
    """Fine-tuning as `camkit.models_def.training.refinement` asks for it."""

    def refinement(self, recipe: BayerRecipe, options: FineTuningOptions) -> Refinement:
        """Prepare the fine-tuning of a recipe; see `make_refinement`."""
        return make_refinement(recipe, options)


REFINING: Final = BayerRefining()
