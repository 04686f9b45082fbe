"""One step of a network and the plate before it; validated on true counts."""

from typing import Any, Final, cast

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.counting import count_softly
from camkit.models_def.kinds.spad.networks import JOINT, JointCamera, build_spad_network
from camkit.models_def.kinds.spad.recipe import PLATE
from camkit.models_def.training.checkpoint import State
from camkit.models_def.training.fitter import Fits, Fitter
from camkit.models_def.training.fitting import FitRequest, OwnFitting
from camkit.models_def.training.losses import training_loss
from camkit.models_def.training.precision import half_precision
from camkit.models_def.training.sample import Batch

VALID_SEED: Final = 606


class PlateFitter:
    """Fits a `JointCamera`: the noise of a step follows from its number."""

    def __init__(self, request: FitRequest) -> None:
        self.inner = Fitter(request.entry, build_spad_network, request.device, request.first)

    def fit(self, batch: Batch, step: int, progress: float) -> float:
        """Train for one step and return its loss."""
        inner, schedule = self.inner, self.inner.schedule
        generator = torch.Generator().manual_seed(schedule.seed * 1_000_003 + step)
        sharp, deviation = batch.planes[:, :1], batch.planes[:, 1:, :1, :1]
        network = cast("JointCamera", inner.network)
        light = count_softly(network.see(sharp), deviation.square().reciprocal(), generator)
        half = half_precision(schedule, inner.device, progress)
        with torch.autocast(inner.device.type, torch.bfloat16, enabled=half):
            found = network.read(light, deviation)
        errors = (found.float() - batch.target).square().mean((1, 2, 3))
        loss = training_loss(schedule.loss, errors)
        inner.descend(loss, step, progress)
        return float(loss.detach())

    def notes(self) -> dict[str, float]:
        """Return the width of the plate's PSF: the root of its second moment along an axis."""
        network = cast("JointCamera", self.inner.averaged)
        with torch.no_grad():
            kernel = network.plate().double()
        place = torch.arange(len(kernel), dtype=torch.float64)
        means, variances = [], []
        for line in (kernel.sum(1), kernel.sum(0)):
            means.append(float((line * place).sum()))
            variances.append(float((line * (place - means[-1]) ** 2).sum()))
        return {
            "plate_sigma": (sum(variances) / 2) ** 0.5,
            "plate_peak": float(kernel.max()),
        }

    def restore(self, planes: Tensor) -> Tensor:
        """Photograph (1, 2, h, w) pictures with true counts and run the averaged network."""
        network = cast("JointCamera", self.inner.averaged)
        generator = torch.Generator().manual_seed(VALID_SEED)
        deviation = planes[:, 1:, :1, :1]
        photons = deviation.square().reciprocal()
        with torch.no_grad():
            light = network.see(planes[:, :1])
            counted = torch.poisson(light.clamp(min=0) * photons, generator=generator) / photons
            return torch.as_tensor(network.read(counted, deviation))

    def weights(self) -> State:
        """Return the weights being trained, the logits of the plate among them."""
        return self.inner.weights()

    def average(self) -> State:
        """Return the averaged weights."""
        return self.inner.average()

    def optimizer_state(self) -> dict[str, Any]:
        """Return the optimiser's state."""
        return self.inner.optimizer_state()

    def load(self, weights: State, average: State, optimizer: dict[str, Any]) -> None:
        """Restore a saved state."""
        self.inner.load(weights, average, optimizer)


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

        def make(_material: Any) -> Fits:
            return PlateFitter(request)

        return OwnFitting(make=make)


FITTING: Final = PlateFitting()
