"""Fitters of a camera behind a mosaic: the losses of what is seen, on simulated and real pairs."""

from pathlib import Path
from typing import Final

from camkit.models_def.kinds.bayer.fine_tuning.bayer_refinement import trace_recipe_distortion
from camkit.models_def.kinds.bayer.fine_tuning.pairs import read_pairs
from camkit.models_def.kinds.bayer.material import BayerMaterial
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.training.adversarial.picture_fitter import Mix
from camkit.models_def.training.adversarial.picture_fitting import picture_fitting
from camkit.models_def.training.fitting import FitRequest, OwnFitting


class BayerFitting:
    """Fulfils `camkit.models_def.training.fitting.FittingKind`."""

    def fitting(self, request: FitRequest) -> OwnFitting | None:
        """Return the fitter of the losses content and adversarial, None for the others.

        Of real pairs, `[fine_tuning]` says how many samples are cut and their share of a batch.
        """
        recipe: BayerRecipe = request.recipe
        seed = request.entry.schedule.seed

        def mixer(folder: Path, material: BayerMaterial) -> Mix:
            distortion = trace_recipe_distortion(recipe, request.recipe_folder)
            pairs = read_pairs(folder, recipe, material.bank, distortion, seed=seed)
            return pairs.mixer(recipe.fine_tuning.pair_share, seed)

        return picture_fitting(request, build_network, mixer)


FITTING: Final = BayerFitting()
