"""Networks that a generator is trained against, with their optimiser."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.networks.discriminator import Discriminator, DiscriminatorConfig
from camkit.models_def.training.adversarial.game import Game, Terms, weighted_sum
from camkit.models_def.training.adversarial.sharp import SharpCrops
from camkit.models_def.training.adversarial.views import Views

Note = Callable[[str, Tensor], None]

SHARP_SEED: Final = 4
STEP_SEED: Final = 1_000_003


@dataclass(frozen=True, slots=True, kw_only=True)
class OpponentPlan:
    """Opponents of a generator, and how they learn.

    Attributes:
        game: Losses of both players.
        weights: Name of an opponent -> how much its opinion counts.
        layers: Name of an opponent -> its strided layers.
        width: Channels of their first layer.
        learning_rate: Peak of Adam's rate, with the decay of the schedule.
        beta1: Of Adam.
        steps: Of the opponents for each of the generator.
        seed: Of their weights.
        sharp: Sharp pictures without captures, or None.
        sharp_share: Share of the true pictures that are replaced by such.
    """

    game: Game
    weights: Mapping[str, float]
    layers: Mapping[str, int]
    width: int
    learning_rate: float
    beta1: float
    steps: int
    seed: int
    sharp: SharpCrops | None = None
    sharp_share: float = 0.0


class Opponents:
    """Opponents of one generator; fulfils `camkit.models_def.training.fitter.Stateful`."""

    def __init__(self, plan: OpponentPlan, draw_seed: int, device: torch.device) -> None:
        """Build them.

        Args:
            plan: Who they are.
            draw_seed: Of what is drawn in a step, which follows from its number.
            device: Where they are.
        """
        self.plan, self._draw_seed = plan, draw_seed
        torch.manual_seed(plan.seed)
        shapes = {
            name: DiscriminatorConfig(layers=layers, width=plan.width)
            for name, layers in plan.layers.items()
        }
        networks = {name: Discriminator(shape) for name, shape in shapes.items()}
        self.networks = nn.ModuleDict(networks).to(device)
        betas = (plan.beta1, 0.999)
        self.optimizer = torch.optim.Adam(
            self.networks.parameters(), lr=plan.learning_rate, betas=betas
        )

    def learn(self, views: Views, step: int, decay: float, note: Note) -> None:
        """Make their steps.

        Generated pictures are the same for all of them; the true ones are partly drawn anew, where
        there are sharp pictures without captures.

        Args:
            views: Output and truth.
            step: Steps of the generator before this one.
            decay: Share of their learning rate.
            note: Takes every term.
        """
        plan = self.plan
        draw = torch.Generator().manual_seed(self._draw_seed * STEP_SEED + step)
        rng = np.random.default_rng((self._draw_seed, SHARP_SEED, step))
        fake = views.fake.detach()
        for group in self.optimizer.param_groups:
            group["lr"] = plan.learning_rate * decay
        self.networks.requires_grad_(requires_grad=True)
        for _ in range(plan.steps):
            real = views.real
            if plan.sharp is not None:
                real = plan.sharp.put_among(rng, real, plan.sharp_share)
            terms = {
                self._label(term, name): value
                for name, judge in self.networks.items()
                for term, value in plan.game.lesson(judge, real, fake, draw).items()
            }
            self.optimizer.zero_grad(set_to_none=True)
            weighted_sum(terms).backward()  # type: ignore[no-untyped-call]
            self.optimizer.step()
            for name, (_, value) in terms.items():
                note(name, value)

    def opinions(self, views: Views) -> Terms:
        """Return what the generator minimises; the opponents do not move."""
        self.networks.requires_grad_(requires_grad=False)
        return {
            self._label("adversarial", name): (
                self.plan.weights[name],
                self.plan.game.opinion(judge, views.real, views.fake),
            )
            for name, judge in self.networks.items()
        }

    def _label(self, term: str, name: str) -> str:
        return term if len(self.networks) == 1 else f"{term}_{name}"

    def state_dict(self) -> dict[str, Any]:
        """Return weights and optimiser."""
        weights = dict(self.networks.state_dict())
        return {"weights": weights, "optimizer": self.optimizer.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore a saved state.

        Raises:
            ContractError: If it is that of other opponents.
        """
        try:
            self.networks.load_state_dict(state["weights"])
        except RuntimeError as error:
            raise ContractError(
                "the checkpoint was trained against a critic or discriminators of another shape; "
                "start without resume"
            ) from error
        self.optimizer.load_state_dict(state["optimizer"])
