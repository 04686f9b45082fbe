"""The fitter of the losses content and adversarial, for any kind whose cameras see three colours.

Such a kind defines `FITTING` beside its `PART`, whose `fitting` gives `picture_fitting(...)`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch

from camkit.caller import option_text
from camkit.colorimetry import rec709_from_camera
from camkit.errors import ContractError
from camkit.models_def.networks.vgg import file_digest
from camkit.models_def.training.adversarial.content import Relu32
from camkit.models_def.training.adversarial.opponents import OpponentPlan
from camkit.models_def.training.adversarial.picture_fitter import PictureParts, picture_fitter
from camkit.models_def.training.adversarial.sharp import SharpCrops
from camkit.models_def.training.adversarial.wasserstein import Wasserstein
from camkit.models_def.training.fitter import BETAS, Fitter, Mix, NetworkBuilder
from camkit.models_def.training.fitting import FitRequest, OwnFitting
from camkit.models_def.training.recipe import PICTURE_LOSSES, ScheduleRecipe

CRITIC: Final = "critic"
CRITIC_SEED: Final = 3

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
    judged = schedule.loss == "adversarial"
    to_rec709 = torch.from_numpy(rec709_from_camera(np.array(matrix)))

    def make(material: Any) -> Fitter:
        mix = None
        if request.pairs is not None and read_pairs is not None:
            mix = read_pairs(request.pairs, material)
        parts = PictureParts(
            content=schedule.content,
            to_rec709=to_rec709,
            features=features,
            opponents=critic_plan(schedule, sharp) if judged else None,
            mix=mix,
            first=request.first,
            device=request.device,
            betas=(schedule.critic.beta1 if judged else BETAS[0], BETAS[1]),
        )
        return picture_fitter(request.entry, build, parts)

    return OwnFitting(make=make, credit=_credit(request, schedule))


def critic_plan(schedule: ScheduleRecipe, sharp: SharpCrops | None = None) -> OpponentPlan:
    """Return the critic of a schedule. References: eqs. (3.8), (3.9)."""
    critic = schedule.critic
    return OpponentPlan(
        game=Wasserstein(penalty=critic.penalty),
        weights={CRITIC: critic.weight},
        layers={CRITIC: critic.layers},
        width=critic.width,
        learning_rate=critic.learning_rate,
        beta1=critic.beta1,
        steps=critic.steps,
        seed=schedule.seed + CRITIC_SEED,
        sharp=sharp,
        sharp_share=critic.sharp_share,
    )


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
    parts = [f"; by the loss {schedule.loss}"]
    if schedule.content.looks and request.vgg is None:
        parts.append("random features in place of VGG-19")
    elif request.vgg is not None:
        digest = file_digest(request.vgg)[:16]
        parts.append(f"VGG-19 features of {request.vgg.name} (sha256 {digest}...)")
    parts += _source("sharp pictures", request.sharp) + _source("real pairs", request.pairs)
    return ", ".join(parts)


def _source(what: str, folder: Path | None) -> list[str]:
    return [] if folder is None else [f"{what} of {folder.name}"]
