"""The state of training: weights, their average, the optimiser; one step at a time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
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
BETAS: Final = (0.9, 0.999)
_NETWORK: Final = "generator"
"""Key of the network's own optimiser where a checkpoint holds further states."""

NetworkBuilder = Callable[..., nn.Module]
"""Of a kind: name and configuration -> an untrained network."""


Mix = Callable[[Batch, int], Batch]
"""A batch and the number of its step -> the batch with patches of real pairs among its own."""


class Stateful(Protocol):
    """Something that a step changes beside the network, such as a critic."""

    def state_dict(self) -> Mapping[str, Any]:
        """Return its state: tensors and plain numbers."""
        ...

    def load_state_dict(self, state: Any) -> Any:
        """Restore a saved state."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """The loss that a network is fitted to, in place of the errors of its patches.

    Attributes:
        loss: The fitter, a batch, the steps done before and the share of the schedule that lies
            behind -> the scalar to descend. It may `note` its terms for the log.
        restore: The averaged network and (1, c, h, w) planes of all inputs -> its picture, where
            validation does more than run the network.
        notes: The averaged network -> what else the log should hold.
        states: Name -> what a step changes beside the network; None where a checkpoint has no
            place for any.
    """

    loss: Callable[["Fitter", Batch, int, float], Tensor]
    restore: Callable[[nn.Module, Tensor], Tensor] | None = None
    notes: Callable[[nn.Module], dict[str, float]] | None = None
    states: Mapping[str, Stateful] | None = None


def run_planes(fitter: "Fitter", batch: Batch, progress: float) -> Tensor:
    """Return what the network makes of the planes of a batch."""
    return fitter.run(batch.planes, progress)


def patch_objective(
    finish: Finish | None = None,
    run: Callable[["Fitter", Batch, float], Tensor] = run_planes,
    mix: Mix | None = None,
) -> Objective:
    """Return the loss of a schedule, on the errors of patches in the square-root domain.

    Args:
        finish: What is done behind the network before its output is judged; None for nothing.
        run: The fitter, a batch and the share of the schedule that lies behind -> the output of
            the network.
        mix: Real pairs among the patches; None for none.
    """

    def loss(fitter: "Fitter", batch: Batch, step: int, progress: float) -> Tensor:
        if mix is not None:
            batch = mix(batch, step)
        schedule, output = fitter.schedule, run(fitter, batch, progress)
        if finish is not None:
            output = finish(output, batch)
        target, weight = batch.target.to(fitter.device), batch.weight.to(fitter.device)
        measure = patch_distances if schedule.loss == "l1" else patch_errors
        errors = measure(output, target, weight)
        if schedule.overshoot:
            errors = errors + schedule.overshoot * overshoots(output, target, weight)
        return training_loss(schedule.loss, errors)

    return Objective(loss=loss)


class Fitter:
    """Fits one network to batches; holds no clock, no file and no random state."""

    def __init__(
        self,
        entry: NetworkRecipe,
        build: NetworkBuilder,
        device: str,
        first: FirstWeights | None = None,
        *,
        objective: Objective | None = None,
        betas: tuple[float, float] = BETAS,
    ) -> None:
        """Build the network with random weights, or with the first ones given.

        Args:
            entry: The network and its schedule.
            build: Builds it.
            device: cpu or cuda.
            first: First weights.
            objective: What it is fitted to; None for the errors of its patches.
            betas: Of AdamW.
        """
        self.schedule, self.device = entry.schedule, torch.device(device)
        self.objective = objective or patch_objective()
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
        self._noted: dict[str, list[float]] = {}

    def fit(self, batch: Batch, step: int, progress: float) -> float:
        """Train for one step and return its loss.

        Args:
            batch: Patches.
            step: Steps done before this one.
            progress: How much of the schedule lies behind, 0..1.
        """
        loss = self.objective.loss(self, batch, step, progress)
        self.descend(loss, step, progress)
        return float(loss.detach())

    def run(self, planes: Tensor, progress: float) -> Tensor:
        """Run the network that is being trained; float32 on its device comes back."""
        planes = planes.to(self.device, memory_format=torch.channels_last)
        with self.precision(progress):
            output: Tensor = self.network(planes)
        return output.float()

    def precision(self, progress: float) -> torch.autocast:
        """Return the context in which a step multiplies, see `half_precision`."""
        half = half_precision(self.schedule, self.device, progress)
        return torch.autocast(self.device.type, torch.bfloat16, enabled=half)

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

    def note(self, name: str, value: Tensor) -> None:
        """Keep the value of a term for the log."""
        self._noted.setdefault(name, []).append(float(value.detach()))

    def notes(self) -> dict[str, float]:
        """Return what else the log should hold: means of what was noted since the last call."""
        means = {name: sum(values) / len(values) for name, values in self._noted.items()}
        self._noted.clear()
        return means | (self.objective.notes(self.averaged) if self.objective.notes else {})

    def restore(self, planes: Tensor) -> Tensor:
        """Run the averaged network on (1, c, h, w) planes; float32 on the CPU comes back."""
        run = self.objective.restore or nn.Module.__call__
        with torch.no_grad():
            return torch.as_tensor(run(self.averaged, planes.to(self.device))).cpu()

    def weights(self) -> State:
        """Return the weights being trained."""
        return _to_cpu(self.network.state_dict())

    def average(self) -> State:
        """Return the averaged weights."""
        return _to_cpu(self.averaged.state_dict())

    def optimizer_state(self) -> dict[str, Any]:
        """Return everything else that a step changes: tensors and plain numbers."""
        network, states = self._optimizer.state_dict(), self.objective.states
        if states is None:
            return network
        return {_NETWORK: network} | {
            name: dict(part.state_dict()) for name, part in states.items()
        }

    def load(self, weights: State, average: State, optimizer: dict[str, Any]) -> None:
        """Restore a saved state.

        Raises:
            ContractError: If it was saved by another fitter.
        """
        states = self.objective.states
        table = {_NETWORK: optimizer} if states is None else optimizer
        if table.keys() != {_NETWORK, *(states or {})} or "param_groups" not in table[_NETWORK]:
            raise ContractError(ANOTHER_LOSS)
        self.network.load_state_dict(weights)
        self.averaged.load_state_dict(average)
        self._optimizer.load_state_dict(table[_NETWORK])
        for name, part in (states or {}).items():
            part.load_state_dict(table[name])


def _to_device(network: nn.Module, device: torch.device) -> nn.Module:
    # Channels last and bfloat16 together take a third of the time on CPUs with matrix units.
    return network.to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return]


def _to_cpu(state: State) -> State:
    return {name: tensor.detach().cpu().clone() for name, tensor in state.items()}
