"""One step: a critic several times, then the generator that it judges.

batch -> generator -> views -+-> critic, its scores of true and generated pictures   several times
                             +-> content terms       |
       weights of the generator <- total loss, eq. (3.9)

Generated pictures are the same for all steps of the critic; the true ones are partly drawn anew,
where there are sharp pictures without captures. All that is drawn follows from the number of the
step.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.networks.discriminator import Discriminator, DiscriminatorConfig
from camkit.models_def.training.adversarial.content import Features, content_terms
from camkit.models_def.training.adversarial.judged import JudgedFitter, Mix, load_judges
from camkit.models_def.training.adversarial.sharp import SharpCrops
from camkit.models_def.training.adversarial.views import Views
from camkit.models_def.training.adversarial.wasserstein import (
    critic_loss,
    generator_loss,
    gradient_penalty,
)
from camkit.models_def.training.checkpoint import State
from camkit.models_def.training.first_weights import FirstWeights
from camkit.models_def.training.fitter import ANOTHER_LOSS, Fitter, NetworkBuilder
from camkit.models_def.training.recipe import CriticRecipe, NetworkRecipe, ScheduleRecipe

BETA2: Final = 0.999
USUAL_BETA1: Final = 0.9
CRITIC_SEED: Final = 3
SHARP_SEED: Final = 4
STEP_SEED: Final = 1_000_003


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureParts:
    """The parts of a `PictureFitter` besides its network and schedule.

    Attributes:
        to_rec709: (3, 3) white-balanced camera colours to linear Rec.709.
        features: Looked through, or None where nothing looks.
        sharp: Sharp pictures without captures, or None.
        mix: Real pairs, or None.
        first: First weights, or None for random ones.
        device: cpu or cuda.
    """

    to_rec709: Tensor
    features: nn.Module | None = None
    sharp: SharpCrops | None = None
    mix: Mix | None = None
    first: FirstWeights | None = None
    device: str = "cpu"


class CriticTraining:
    """A critic with its optimiser."""

    def __init__(self, schedule: ScheduleRecipe, device: torch.device) -> None:
        self.recipe: CriticRecipe = schedule.critic
        torch.manual_seed(schedule.seed + CRITIC_SEED)
        shape = DiscriminatorConfig(layers=self.recipe.layers, width=self.recipe.width)
        self.network = Discriminator(shape).to(device)
        self._optimizer = torch.optim.Adam(
            self.network.parameters(),
            lr=self.recipe.learning_rate,
            betas=(self.recipe.beta1, BETA2),
        )

    def scores(self, pictures: Tensor) -> Tensor:
        """Return (b,) scores of (b, 3, h, w) sRGB pictures in 0..1: means over all places."""
        return torch.as_tensor(self.network(pictures)).mean((1, 2, 3))

    def learn(
        self, real: Tensor, fake: Tensor, draw: torch.Generator, *, decay: float
    ) -> tuple[Tensor, Tensor]:
        """Train for one step; return the loss without penalty, and the penalty before its weight.

        Args:
            real: (b, 3, h, w) true pictures.
            fake: (b, 3, h, w) generated ones.
            draw: Of places between them.
            decay: Of the learning rate.
        """
        for group in self._optimizer.param_groups:
            group["lr"] = self.recipe.learning_rate * decay
        self.network.requires_grad_(requires_grad=True)
        apart = critic_loss(self.scores(real), self.scores(fake))
        penalty = gradient_penalty(self.scores, real, fake, draw)
        self._optimizer.zero_grad(set_to_none=True)
        (apart + self.recipe.penalty * penalty).backward()  # type: ignore[no-untyped-call]
        self._optimizer.step()
        return apart.detach(), penalty.detach()

    def opinion(self, fake: Tensor) -> Tensor:
        """Return the loss of the generator; the critic does not move."""
        self.network.requires_grad_(requires_grad=False)
        return generator_loss(self.scores(fake))

    def state(self) -> dict[str, Any]:
        """Return weights and optimiser."""
        return {
            "weights": dict(self.network.state_dict()),
            "optimizer": self._optimizer.state_dict(),
        }

    def load(self, state: dict[str, Any]) -> None:
        """Restore a saved state.

        Raises:
            ContractError: If it is that of another critic.
        """
        load_judges(self.network, state["weights"])
        self._optimizer.load_state_dict(state["optimizer"])


class PictureFitter(JudgedFitter):
    """Fits a generator to the content terms, with a critic where the loss asks for one."""

    def __init__(self, entry: NetworkRecipe, build: NetworkBuilder, parts: PictureParts) -> None:
        schedule = entry.schedule
        judged = schedule.loss == "adversarial"
        betas = (schedule.critic.beta1 if judged else USUAL_BETA1, BETA2)
        generator = Fitter(entry, build, parts.device, parts.first, betas)
        super().__init__(generator, parts.to_rec709, parts.mix)
        self.critic = CriticTraining(schedule, generator.device) if judged else None
        self._sharp = parts.sharp
        self._features: Features | None = (
            None if parts.features is None else parts.features.to(generator.device)
        )

    def teach(self, views: Views, step: int, decay: float) -> None:
        """Train the critic for its steps."""
        critic, sharp = self.critic, self._sharp
        if critic is None:
            return
        draw = torch.Generator().manual_seed(self.schedule.seed * STEP_SEED + step)
        rng = np.random.default_rng((self.schedule.seed, SHARP_SEED, step))
        fake, share = views.seen.detach(), critic.recipe.sharp_share
        for _ in range(critic.recipe.steps):
            real = views.real if sharp is None else sharp.put_among(rng, views.real, share)
            apart, penalty = critic.learn(real, fake, draw, decay=decay)
            self.note("critic", apart)
            self.note("penalty", penalty)

    def total(self, views: Views) -> Tensor:
        """Return the content terms, and the critic's opinion. References: eq. (3.9)."""
        terms = content_terms(views, self.schedule.content, self._features)
        if self.critic is not None:
            terms["adversarial"] = self.critic.recipe.weight, self.critic.opinion(views.seen)
        for name, (_, value) in terms.items():
            self.note(name, value)
        return torch.stack([weight * value for weight, value in terms.values()]).sum()

    def optimizer_state(self) -> dict[str, Any]:
        """Return the generator's optimiser, and the critic with its own: tensors and numbers."""
        state = {"generator": self.generator.optimizer_state()}
        return state if self.critic is None else state | {"critic": self.critic.state()}

    def load(self, weights: State, average: State, optimizer: dict[str, Any]) -> None:
        """Restore a saved state.

        Raises:
            ContractError: If it was saved by another fitter, or with a critic where there is none
                now, or the reverse.
        """
        if "generator" not in optimizer or (self.critic is None) == ("critic" in optimizer):
            raise ContractError(ANOTHER_LOSS)
        self.generator.load(weights, average, optimizer["generator"])
        if self.critic is not None:
            self.critic.load(optimizer["critic"])
