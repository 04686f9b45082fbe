"""One step of fine-tuning: both discriminators learn, then the generator.

batch (+ real pairs) -> generator -> views -+-> discriminators, scores of output and truth
                                            +-> content loss       |
                  weights of the generator <- total loss, eq. (6.14)
"""

from dataclasses import dataclass
from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.models_def.kinds.bayer.fine_tuning.adversarial import discriminator_loss, generator_loss
from camkit.models_def.kinds.bayer.fine_tuning.content import perceptual_loss
from camkit.models_def.kinds.bayer.fine_tuning.vgg import VggFeatures
from camkit.models_def.kinds.bayer.recipe import FineTuningRecipe
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.networks.discriminator import Discriminator, DiscriminatorConfig
from camkit.models_def.training.adversarial.judged import JudgedFitter, Mix, load_judges
from camkit.models_def.training.adversarial.views import Views, pixel_loss
from camkit.models_def.training.checkpoint import State
from camkit.models_def.training.first_weights import FirstWeights
from camkit.models_def.training.fitter import Fitter
from camkit.models_def.training.recipe import NetworkRecipe

OPPONENT_SEED: Final = 2
BETAS: Final = (0.9, 0.999)


@dataclass(frozen=True, slots=True, kw_only=True)
class FineTuningParts:
    """The parts of fine-tuning besides its recipe.

    Attributes:
        first: Weights that the generator starts from.
        to_rec709: (3, 3) white-balanced camera colours to linear Rec.709.
        features: VGG-19, or None.
        mix: Real pairs, or None.
        device: cpu or cuda.
    """

    first: FirstWeights
    to_rec709: Tensor
    features: VggFeatures | None = None
    mix: Mix | None = None
    device: str = "cpu"


class FineTuningFitter(JudgedFitter):
    """Fits a generator against a global and a local discriminator. References: eq. (6.14)."""

    def __init__(
        self, entry: NetworkRecipe, recipe: FineTuningRecipe, parts: FineTuningParts
    ) -> None:
        generator = Fitter(entry, build_network, parts.device, parts.first)
        super().__init__(generator, parts.to_rec709, parts.mix)
        self.recipe, device = recipe, generator.device
        self._features = None if parts.features is None else parts.features.to(device)
        torch.manual_seed(entry.schedule.seed + OPPONENT_SEED)
        self.opponents = nn.ModuleDict(
            {
                name: Discriminator(
                    DiscriminatorConfig(layers=layers, width=recipe.discriminator_width)
                )
                for name, layers in (
                    ("global", recipe.global_layers),
                    ("local", recipe.local_layers),
                )
            }
        ).to(device)
        self._shares = {"global": recipe.global_weight, "local": recipe.local_weight}
        self._optimizer = torch.optim.Adam(
            self.opponents.parameters(), lr=recipe.discriminator_rate, betas=BETAS
        )

    def teach(self, views: Views, step: int, decay: float) -> None:
        """Train both discriminators for one step."""
        del step
        for group in self._optimizer.param_groups:
            group["lr"] = self.recipe.discriminator_rate * decay
        self.opponents.requires_grad_(requires_grad=True)
        losses = {
            name: discriminator_loss(judge(views.real), judge(views.seen.detach()))
            for name, judge in self.opponents.items()
        }
        self._optimizer.zero_grad(set_to_none=True)
        torch.stack([*losses.values()]).sum().backward()  # type: ignore[no-untyped-call]
        self._optimizer.step()
        for name, loss in losses.items():
            self.note(f"discriminator_{name}", loss)

    def total(self, views: Views) -> Tensor:
        """Return the sum of pixel, feature and discriminator losses; discriminators do not move."""
        self.opponents.requires_grad_(requires_grad=False)
        pixel, perceptual = pixel_loss(views), perceptual_loss(views, self._features)
        self.note("pixel", pixel)
        self.note("perceptual", perceptual)
        total = self.recipe.perceptual_weight * perceptual + self.recipe.pixel_weight * pixel
        for name, judge in self.opponents.items():
            adversarial = generator_loss(judge(views.real), judge(views.seen))
            self.note(f"adversarial_{name}", adversarial)
            total = total + self._shares[name] * adversarial
        return total

    def optimizer_state(self) -> dict[str, Any]:
        """Return both optimisers and the discriminators: tensors and plain numbers."""
        return {
            "generator": self.generator.optimizer_state(),
            "opponents": self._optimizer.state_dict(),
            "opponent_weights": dict(self.opponents.state_dict()),
        }

    def load(self, weights: State, average: State, optimizer: dict[str, Any]) -> None:
        """Restore a saved state.

        Raises:
            ContractError: If it is that of other discriminators.
        """
        self.generator.load(weights, average, optimizer["generator"])
        load_judges(self.opponents, optimizer["opponent_weights"])
        self._optimizer.load_state_dict(optimizer["opponents"])
