"""The fitter of the losses content and adversarial, for any kind whose cameras see three colours.

Such a kind defines `FITTING` beside its `PART`, whose `fitting` gives `picture_fitting(...)`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from camkit.caller import option_text
from camkit.colorimetry import rec709_from_camera
from camkit.errors import ContractError
from camkit.models_def.networks.vgg import file_digest
from camkit.models_def.training.adversarial.content import Relu32
from camkit.models_def.training.adversarial.fitter import PictureFitter, PictureParts
from camkit.models_def.training.adversarial.judged import Mix
from camkit.models_def.training.adversarial.sharp import SharpCrops
from camkit.models_def.training.fitter import Fits, NetworkBuilder
from camkit.models_def.training.fitting import FitRequest, OwnFitting
from camkit.models_def.training.recipe import PICTURE_LOSSES, ScheduleRecipe

PairReader = Callable[[Path, Any], Mix]
"""From a folder of real pairs, and the material of the samples."""


def picture_fitting(
    request: FitRequest, build: NetworkBuilder, read_pairs: PairReader | None = None
) -> OwnFitting | None:
    """Return the fitter of a request, None where its loss is another.

    Args:
        request: Its recipe has a sensor with a colour matrix.
        build: Builds networks of the kind.
        read_pairs: Reads real pairs, where the kind can.

    Raises:
        ContractError: If something is missing, or files were given in vain.
    """
    schedule = request.entry.schedule
    if schedule.loss not in PICTURE_LOSSES:
        return None
    _check_files(request, schedule)
    matrix = getattr(request.recipe.sensor, "color_matrix", None)
    if matrix is None:
        raise ContractError(f"the loss {schedule.loss} needs sensor.color_matrix, to see pictures")
    if request.pairs is not None and read_pairs is None:
        raise ContractError(
            f"this kind of camera does not train on real pairs: leave {option_text('pairs')} away"
        )
    features = Relu32(request.vgg) if schedule.content.looks else None
    sharp = None if request.sharp is None else SharpCrops(request.sharp)
    to_rec709 = torch.from_numpy(rec709_from_camera(np.array(matrix)))

    def make(material: Any) -> Fits:
        mix = None
        if request.pairs is not None and read_pairs is not None:
            mix = read_pairs(request.pairs, material)
        parts = PictureParts(
            to_rec709=to_rec709,
            features=features,
            sharp=sharp,
            mix=mix,
            first=request.first,
            device=request.device,
        )
        return PictureFitter(request.entry, build, parts)

    return OwnFitting(make=make, credit=_credit(request, schedule))


def _check_files(request: FitRequest, schedule: ScheduleRecipe) -> None:
    if request.vgg is not None and not schedule.content.looks:
        raise ContractError(
            "schedule.content looks at no features (gram_weight, feature_weight): leave "
            f"{option_text('vgg')} away"
        )
    if request.sharp is not None and schedule.loss != "adversarial":
        raise ContractError(
            f"the loss {schedule.loss} has no critic: leave {option_text('sharp')} away"
        )


def _credit(request: FitRequest, schedule: ScheduleRecipe) -> str:
    """Return the further training data of the weights, for the card."""
    said = [f"; by the loss {schedule.loss}"]
    if schedule.content.looks and request.vgg is None:
        said.append("random features in place of VGG-19")
    elif request.vgg is not None:
        digest = file_digest(request.vgg)[:16]
        said.append(f"VGG-19 features of {request.vgg.name} (sha256 {digest}...)")
    said += _named("sharp pictures", request.sharp) + _named("real pairs", request.pairs)
    return ", ".join(said)


def _named(what: str, folder: Path | None) -> list[str]:
    return [] if folder is None else [f"{what} of {folder.name}"]
