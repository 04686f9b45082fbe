"""The base of fitters whose generator is judged by the look of its pictures.

batch (+ real pairs) -> generator -> views -+-> opponents learn
                                            +-> total loss -> weights of the generator
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.training.adversarial.views import Views, make_views
from camkit.models_def.training.checkpoint import State
from camkit.models_def.training.fitter import Fitter
from camkit.models_def.training.sample import Batch
from camkit.models_def.training.schedule import learning_rate

Mix = Callable[[Batch, int], Batch]
"""A batch and the number of its step -> the batch with patches of real pairs among its own."""


def load_judges(network: nn.Module, weights: State) -> None:
    """Load the weights of a checkpoint into the opponents of a generator, in place.

    Raises:
        ContractError: If they are those of other opponents.
    """
    try:
        network.load_state_dict(weights)
    except RuntimeError as error:
        raise ContractError(
            "the checkpoint was trained against a critic or discriminators of another shape; "
            "start without resume"
        ) from error


class JudgedFitter(ABC):
    """Fits a generator; who judges it, and by what, is left to others."""

    def __init__(self, generator: Fitter, to_rec709: Tensor, mix: Mix | None) -> None:
        """Store the generator and the sources of real pictures.

        Args:
            generator: Fits the network.
            to_rec709: (3, 3) white-balanced camera colours to linear Rec.709.
            mix: Real pairs, or None.
        """
        self.generator, self.schedule = generator, generator.schedule
        self._to_rec709 = to_rec709.float().to(generator.device)
        self._mix = mix
        self._notes: dict[str, list[float]] = {}

    @abstractmethod
    def teach(self, views: Views, step: int, decay: float) -> None:
        """Train the opponents, if there are any, at a share `decay` of their rate."""

    @abstractmethod
    def total(self, views: Views) -> Tensor:
        """Return the loss of the generator."""

    @abstractmethod
    def optimizer_state(self) -> dict[str, Any]:
        """Return the generator's optimiser, and the opponents with theirs: tensors and numbers."""

    @abstractmethod
    def load(self, weights: State, average: State, optimizer: dict[str, Any]) -> None:
        """Restore a saved state."""

    def fit(self, batch: Batch, step: int, progress: float) -> float:
        """Train all networks for one step and return the generator's loss."""
        if self._mix is not None:
            batch = self._mix(batch, step)
        device = self.generator.device
        output = self.generator.run(batch.planes, progress)
        views = make_views(
            output, batch.target.to(device), batch.weight.to(device), self._to_rec709
        )
        decay = learning_rate(self.schedule, step, progress) / self.schedule.learning_rate
        self.teach(views, step, decay)
        loss = self.total(views)
        self.generator.descend(loss, step, progress)
        return float(loss.detach())

    def note(self, name: str, value: Tensor) -> None:
        """Record the value of a term for the log."""
        self._notes.setdefault(name, []).append(float(value.detach()))

    def notes(self) -> dict[str, float]:
        """Return the mean of each term since the last call."""
        means = {name: sum(values) / len(values) for name, values in self._notes.items()}
        self._notes.clear()
        return means

    def restore(self, planes: Tensor) -> Tensor:
        """Run the averaged generator on (1, c, h, w) planes; float32 on the CPU comes back."""
        return self.generator.restore(planes)

    def weights(self) -> State:
        """Return the generator's weights being trained."""
        return self.generator.weights()

    def average(self) -> State:
        """Return the generator's averaged weights."""
        return self.generator.average()
