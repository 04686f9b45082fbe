"""One step of a network and the plate before it; validated on true counts."""

from typing import Final, cast

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.counting import count_softly
from camkit.models_def.kinds.spad.networks import JOINT, JointCamera, build_spad_network
from camkit.models_def.kinds.spad.recipe import PLATE
from camkit.models_def.training.fitter import Fitter, Objective
from camkit.models_def.training.fitting import FitRequest, OwnFitting
from camkit.models_def.training.losses import training_loss
from camkit.models_def.training.sample import Batch

VALID_SEED: Final = 606


def plate_fitter(request: FitRequest) -> Fitter:
    """Return what fits a `JointCamera`: the noise of a step follows from its number."""
    objective = Objective(loss=_loss, restore=_restored, notes=_plate_facts)
    return Fitter(
        request.entry, build_spad_network, request.device, request.first, objective=objective
    )


def _loss(fitter: Fitter, batch: Batch, step: int, progress: float) -> Tensor:
    """Return the loss of a batch, whose photons are counted so that gradients pass."""
    schedule = fitter.schedule
    generator = torch.Generator().manual_seed(schedule.seed * 1_000_003 + step)
    sharp, deviation = batch.planes[:, :1], batch.planes[:, 1:, :1, :1]
    network = cast("JointCamera", fitter.network)
    light = count_softly(network.see(sharp), deviation.square().reciprocal(), generator)
    with fitter.precision(progress):
        output = network.read(light, deviation)
    errors = (output.float() - batch.target).square().mean((1, 2, 3))
    return training_loss(schedule.loss, errors)


def _restored(averaged: nn.Module, planes: Tensor) -> Tensor:
    """Photograph (1, 2, h, w) pictures with true counts and run the averaged network."""
    network = cast("JointCamera", averaged)
    generator = torch.Generator().manual_seed(VALID_SEED)
    deviation = planes[:, 1:, :1, :1]
    photons = deviation.square().reciprocal()
    light = network.see(planes[:, :1])
    counted = torch.poisson(light.clamp(min=0) * photons, generator=generator) / photons
    return network.read(counted, deviation)


def _plate_facts(averaged: nn.Module) -> dict[str, float]:
    """Return how wide the plate spreads light: the root of its second moment along an axis."""
    with torch.no_grad():
        kernel = cast("JointCamera", averaged).plate().double()
    place = torch.arange(len(kernel), dtype=torch.float64)
    means, variances = [], []
    for line in (kernel.sum(1), kernel.sum(0)):
        means.append(float((line * place).sum()))
        variances.append(float((line * (place - means[-1]) ** 2).sum()))
    return {"plate_sigma": (sum(variances) / 2) ** 0.5, "plate_peak": float(kernel.max())}


class PlateFitting:
    """Fulfils `camkit.models_def.training.fitting.FittingKind`."""

    def fitting(self, request: FitRequest) -> OwnFitting | None:
        """Return the fitter of the role plate; None for the other.

        Raises:
            ContractError: If the network does not suit the role, or the device.
        """
        joint = request.entry.network.startswith(JOINT)
        if joint != (request.role == PLATE):
            raise ContractError(
                f"networks whose names begin with {JOINT} belong to the role {PLATE}, others to "
                f"upscale; got {request.entry.network} in {request.role}"
            )
        if not joint:
            return None
        if request.device != "cpu":
            raise ContractError(f"a plate is trained on the cpu; got {request.device}")

        return OwnFitting(make=lambda _: plate_fitter(request))


FITTING: Final = PlateFitting()
