"""The state of training: weights, their average, the optimiser; one step at a time."""

from collections.abc import Callable
from typing import Any, Final, Protocol

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.training.checkpoint import State
from camkit.models_def.training.first_weights import FirstWeights, take_first_weights
from camkit.models_def.training.losses import (
    overshoots,
    patch_distances,
    patch_errors,
    training_loss,
)
from camkit.models_def.training.precision import half_precision
from camkit.models_def.training.recipe import NetworkRecipe
from camkit.models_def.training.sample import Batch, Finish
from camkit.models_def.training.schedule import ema_decay, learning_rate, update_average

ANOTHER_LOSS: Final = "the checkpoint was trained by another loss; start without resume"

NetworkBuilder = Callable[..., nn.Module]
"""Of a kind: name and configuration -> an untrained network."""


class Fits(Protocol):
    """The interface of a fitter."""

    def fit(self, batch: Batch, step: int, progress: float) -> float:
        """Train for one step and return its loss."""
        ...

    def restore(self, planes: Tensor) -> Tensor:
        """Run the averaged network on the (1, c, h, w) planes of all inputs."""
        ...

    def weights(self) -> State:
        """Return the weights being trained."""
        ...

    def average(self) -> State:
        """Return the averaged weights."""
        ...

    def optimizer_state(self) -> dict[str, Any]:
        """Return everything else that a step changes: tensors and plain numbers."""
        ...

    def load(self, weights: State, average: State, optimizer: dict[str, Any]) -> None:
        """Restore a saved state."""
        ...

    def notes(self) -> dict[str, float]:
        """Return further entries of the log since the last call."""
        ...


class Fitter:
    """Fits one network to batches; holds no clock, no file and no random state."""

    def __init__(
        self,
        entry: NetworkRecipe,
        build: NetworkBuilder,
        device: str,
        first: FirstWeights | None = None,
        betas: tuple[float, float] = (0.9, 0.999),
        finish: Finish | None = None,
    ) -> None:
        """Build the network with random weights, or with the first ones given.

        Args:
            entry: The network and its schedule.
            build: Builds it.
            device: cpu or cuda.
            first: First weights.
            betas: Of AdamW.
            finish: What is done behind the network before its output is judged; None for nothing.
        """
        self._finish = finish
        self.schedule, self.device = entry.schedule, torch.device(device)
        torch.manual_seed(entry.schedule.seed)
        self.network = _to_device(build(entry.network, **entry.config), self.device)
        if first is not None:
            take_first_weights(self.network, first)
        self.averaged = _to_device(build(entry.network, **entry.config), self.device)
        self.averaged.load_state_dict(self.network.state_dict())
        self._average = [p.detach() for p in self.averaged.parameters()]
        self._optimizer = torch.optim.AdamW(
            self.network.parameters(),
            lr=entry.schedule.learning_rate,
            betas=betas,
            weight_decay=entry.schedule.weight_decay,
            fused=True,
        )

    def fit(self, batch: Batch, step: int, progress: float) -> float:
        """Train for one step and return its loss.

        Args:
            batch: Patches.
            step: Steps done before this one.
            progress: How much of the schedule lies behind, 0..1.
        """
        output = self.run(batch.planes, progress)
        if self._finish is not None:
            output = self._finish(output, batch)
        target, weight = batch.target.to(self.device), batch.weight.to(self.device)
        measure = patch_distances if self.schedule.loss == "l1" else patch_errors
        errors = measure(output, target, weight)
        if self.schedule.overshoot:
            errors = errors + self.schedule.overshoot * overshoots(output, target, weight)
        loss = training_loss(self.schedule.loss, errors)
        self.descend(loss, step, progress)
        return float(loss.detach())

    def run(self, planes: Tensor, progress: float) -> Tensor:
        """Run the network that is being trained; float32 on its device comes back."""
        half = half_precision(self.schedule, self.device, progress)
        planes = planes.to(self.device, memory_format=torch.channels_last)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=half):
            output: Tensor = self.network(planes)
        return output.float()

    def descend(self, loss: Tensor, step: int, progress: float) -> None:
        """Move the weights down a scalar loss of `run`, and their average after them."""
        schedule = self.schedule
        for group in self._optimizer.param_groups:
            group["lr"] = learning_rate(schedule, step, progress)
        self._optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.network.parameters(), schedule.gradient_clip)
        self._optimizer.step()
        update_average(self._average, self.network.parameters(), ema_decay(schedule, step))

    def notes(self) -> dict[str, float]:
        """Return no further entries of the log."""
        return {}

    def restore(self, planes: Tensor) -> Tensor:
        """Run the averaged network on (1, c, h, w) planes; float32 on the CPU comes back."""
        with torch.no_grad():
            return torch.as_tensor(self.averaged(planes.to(self.device))).cpu()

    def weights(self) -> State:
        """Return the weights being trained."""
        return _to_cpu(self.network.state_dict())

    def average(self) -> State:
        """Return the averaged weights."""
        return _to_cpu(self.averaged.state_dict())

    def optimizer_state(self) -> dict[str, Any]:
        """Return the optimiser's state: tensors and plain numbers."""
        return self._optimizer.state_dict()

    def load(self, weights: State, average: State, optimizer: dict[str, Any]) -> None:
        """Restore a saved state.

        Raises:
            ContractError: If it was saved by another fitter.
        """
        if "param_groups" not in optimizer:
            raise ContractError(ANOTHER_LOSS)
        self.network.load_state_dict(weights)
        self.averaged.load_state_dict(average)
        self._optimizer.load_state_dict(optimizer)


def _to_device(network: nn.Module, device: torch.device) -> nn.Module:
    # Channels last and bfloat16 together take a third of the time on CPUs with matrix units.
    return network.to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return]


def _to_cpu(state: State) -> State:
    return {name: tensor.detach().cpu().clone() for name, tensor in state.items()}
