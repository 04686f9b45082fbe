"""One step of the thesis's networks by its losses, in linear light.

split       L_U on the picture without streaks, and the perceptual loss of the streaks
highlight   L_S
fusion      L_F
whole       L_total, all three in a row
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, cast

import torch
from torch import Tensor

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.chain import ThesisChain
from camkit.models_def.kinds.hdr.thesis.networks import (
    THESIS_NAMES,
    BetweenRoots,
    build_thesis_network,
    to_light,
)
from camkit.models_def.kinds.hdr.thesis.thesis_losses import (
    exclusion_loss,
    fused_loss,
    perceptual_loss,
    saturated_loss,
    total_loss,
    unsaturated_loss,
)
from camkit.models_def.kinds.hdr.thesis_recipe import ThesisRecipe
from camkit.models_def.networks.vgg import VggLevels, file_digest, take_vgg
from camkit.models_def.training.fitter import Fitter, Objective
from camkit.models_def.training.fitting import FitRequest, OwnFitting
from camkit.models_def.training.sample import Batch
from camkit.scenes.saturation import CEILING

LOSS_BLOCKS: Final = 4
"""Of VGG-19: the losses look at conv2_2, conv3_2 and conv4_2."""
OF_ROLE: Final = {
    "split": "thesis_split",
    "highlight": "thesis_highlight",
    "fusion": "thesis_fusion",
    "whole": "thesis_chain",
}

Terms = dict[str, Tensor]


class ThesisLoss:
    """The losses of one of the thesis's networks, or of all three."""

    def __init__(self, request: FitRequest) -> None:
        self.recipe: ThesisRecipe = request.recipe.thesis
        self._terms = _TERMS[request.role]
        self.features = VggLevels(blocks=LOSS_BLOCKS, widths=self.recipe.vgg_widths)
        if request.vgg is not None:
            give_vgg(self.features, request.vgg)
        self.features.to(request.device)

    def of(self, fitter: Fitter, batch: Batch, step: int, progress: float) -> Tensor:
        """Return the loss of a batch."""
        del step
        light, target = (to_light(x.to(fitter.device)) for x in (batch.planes, batch.target))
        terms = self._terms(self, cast("BetweenRoots", fitter.network), light, target)
        for name, value in terms.items():
            fitter.note(name, value)
        return self._total(terms, progress, torch.zeros((), device=fitter.device))

    def _total(self, terms: Mapping[str, Tensor], progress: float, zero: Tensor) -> Tensor:
        recipe = self.recipe
        excludes = progress >= recipe.exclusion_from
        unsaturated = unsaturated_loss(
            terms.get("clean", zero),
            terms.get("exclusion", zero),
            perceptual_weight=recipe.perceptual_weight,
            exclusion_weight=recipe.exclusion_weight if excludes else 0.0,
        )
        saturated = saturated_loss(terms.get("lights", zero), weight=recipe.highlight_weight)
        total = total_loss(unsaturated, saturated, terms.get("fused", zero))
        return total + recipe.streak_weight * terms.get("streaks", zero)

    def perceptual(self, output: Tensor, target: Tensor) -> Tensor:
        """Return the perceptual loss of (b, 3, h, w) linear pictures."""
        with torch.no_grad():
            truth = self.features(target)
        return perceptual_loss(self.features(output)[1:], truth[1:])


def thesis_fitter(request: FitRequest) -> Fitter:
    """Return the fitter of one of the thesis's networks, or of all three."""
    objective = Objective(loss=ThesisLoss(request).of)
    fitter = Fitter(
        request.entry, build_thesis_network, request.device, request.first, objective=objective
    )
    if request.vgg is not None:
        give_vgg(fitter.network, request.vgg)
        give_vgg(fitter.averaged, request.vgg)
    return fitter


def _split_terms(loss: ThesisLoss, network: BetweenRoots, light: Tensor, target: Tensor) -> Terms:
    clean, streaks = torch.split(network.linear(light), 3, dim=1)
    terms = {
        "clean": loss.perceptual(clean, target[:, :3]),
        "exclusion": exclusion_loss(clean, streaks),
    }
    if loss.recipe.streak_weight > 0:
        terms["streaks"] = loss.perceptual(streaks, target[:, 3:])
    return terms


def _highlight_terms(
    loss: ThesisLoss, network: BetweenRoots, light: Tensor, target: Tensor
) -> Terms:
    return {"lights": loss.perceptual(network.linear(light), target)}


def _fusion_terms(loss: ThesisLoss, network: BetweenRoots, light: Tensor, target: Tensor) -> Terms:
    del loss
    return {"fused": fused_loss(network.linear(light), target)}


def _whole_terms(loss: ThesisLoss, network: BetweenRoots, light: Tensor, target: Tensor) -> Terms:
    outputs = cast("ThesisChain", network.body).outputs(light)
    return {
        "clean": loss.perceptual(outputs.clean, target.clamp(max=1)),
        "exclusion": exclusion_loss(outputs.clean, outputs.streaks),
        "lights": loss.perceptual(outputs.lights, target.clamp(1, CEILING)),
        "fused": fused_loss(outputs.fused, target),
    }


_TERMS: Final[Mapping[str, Callable[[ThesisLoss, BetweenRoots, Tensor, Tensor], Terms]]] = {
    "split": _split_terms,
    "highlight": _highlight_terms,
    "fusion": _fusion_terms,
    "whole": _whole_terms,
}


def give_vgg(network: torch.nn.Module, path: Path) -> None:
    """Load the weights of a file into every VGG-19 within a network; see `take_vgg`."""
    for part in network.modules():
        if isinstance(part, VggLevels):
            take_vgg(part, path)


class ThesisFitting:
    """Fulfils `camkit.models_def.training.fitting.FittingKind`."""

    def fitting(self, request: FitRequest) -> OwnFitting | None:
        """Return the fitter of the thesis's networks; None for all others.

        Raises:
            ContractError: If the network is not that of the role, weights of VGG-19 are missing,
                or the schedule wants less than float32.
        """
        network = request.entry.network
        if request.role not in OF_ROLE or (request.role == "whole" and network not in THESIS_NAMES):
            return None
        _check(request)

        return OwnFitting(make=lambda _: thesis_fitter(request), credit=_credit(request))


def _check(request: FitRequest) -> None:
    network = OF_ROLE[request.role]
    if request.entry.network != network:
        raise ContractError(
            f"the network of the role {request.role} is {network}; got {request.entry.network}"
        )
    if request.entry.schedule.precision != "float32":
        raise ContractError(
            'lights of 2^8 need schedule.precision = "float32" with the thesis\'s networks; got '
            f"{request.entry.schedule.precision!r}"
        )
    if request.role != "fusion" and request.vgg is None and not request.recipe.thesis.random_vgg:
        raise ContractError(
            f"the role {request.role} looks at pictures through VGG-19: give its weights by "
            f"{option_text('vgg')} (a file of torchvision's vgg19), or state random_vgg = true in "
            "[thesis] to try the machinery with random ones"
        )


def _credit(request: FitRequest) -> str:
    if request.role == "fusion":
        return ""
    if request.vgg is None:
        return "; VGG-19 with random weights"
    digest = file_digest(request.vgg)[:16]
    return f"; with VGG-19 of {request.vgg.name} (sha256 {digest}...)"


FITTING: Final = ThesisFitting()
