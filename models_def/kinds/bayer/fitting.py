"""Fitters of a camera behind a mosaic: the losses of what is seen, on simulated and real pairs."""

from pathlib import Path
from typing import Final

from camkit.models_def.kinds.bayer.fine_tuning.bayer_refinement import trace_recipe_distortion
from camkit.models_def.kinds.bayer.fine_tuning.pairs import read_pairs
from camkit.models_def.kinds.bayer.material import BayerMaterial
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import finish_of
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.training.adversarial.picture_fitting import PairReader, picture_fitting
from camkit.models_def.training.fitter import Fitter, Mix, patch_objective
from camkit.models_def.training.fitting import FitRequest, OwnFitting
from camkit.models_def.training.recipe import PICTURE_LOSSES


class BayerFitting:
    """Fulfils `camkit.models_def.training.fitting.FittingKind`."""

    def fitting(self, request: FitRequest) -> OwnFitting | None:
        """Return the fitter of real pairs or of the losses content and adversarial, else None.

        Of real pairs, `[fine_tuning]` says how many samples are cut and their share of a batch.
        """
        recipe: BayerRecipe = request.recipe
        seed = request.entry.schedule.seed

        def mixer(folder: Path, material: BayerMaterial) -> Mix:
            distortion = trace_recipe_distortion(recipe, request.recipe_folder)
            pairs = read_pairs(folder, recipe, material.bank, distortion, seed=seed)
            return pairs.mixer(recipe.fine_tuning.pair_share, seed)

        if request.pairs is not None and request.entry.schedule.loss not in PICTURE_LOSSES:
            return _plain_fitting(request, request.pairs, mixer)
        return picture_fitting(request, build_network, mixer)


def _plain_fitting(request: FitRequest, folder: Path, read: PairReader) -> OwnFitting | None:
    """Return the fitter of a schedule's own loss with real pairs in its batches.

    Files of other losses are refused by who asked: None is returned where there are any.
    """
    if request.vgg is not None or request.sharp is not None:
        return None
    entry, finish = request.entry, finish_of(request.recipe)

    def make(material: BayerMaterial) -> Fitter:
        objective = patch_objective(finish, mix=read(folder, material))
        return Fitter(entry, build_network, request.device, request.first, objective=objective)

    share = request.recipe.fine_tuning.pair_share
    return OwnFitting(make=make, credit=f"; a share of {share:g} of real pairs of {folder.name}")


FITTING: Final = BayerFitting()
