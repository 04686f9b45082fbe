"""The losses of a critic and of the generator that it judges: WGAN with a gradient penalty.

Eq. (3.8) of the thesis prints the critic's terms with the sign of what a critic makes larger, and
the penalty, which it makes smaller, with the same sign; and it takes the penalty's gradient at
generated pictures. The cited source (Gulrajani et al. 2017, after Arjovsky et al. 2017) has

    critic      E[D(fake)] - E[D(real)] + lambda E[(|grad D(x)| - 1)^2], x between real and fake
    generator   -E[D(fake)]

which is what these functions compute. The norm is that of the whole picture's gradient; the public
code of the authors takes it over the colours of each pixel.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.training.adversarial.game import Judge, Terms

LEAST_SQUARE: Final = 1e-24
"""The root of an exact zero has no gradient."""

Critic = Callable[[Tensor], Tensor]
"""(b, c, h, w) pictures -> (b,) scores, each of one picture alone."""


def critic_loss(real: Tensor, fake: Tensor) -> Tensor:
    """Return the loss of a critic without its penalty, from scores of any shape.

    Its negative estimates how far the two distributions lie apart.
    """
    return fake.mean() - real.mean()


def generator_loss(fake: Tensor) -> Tensor:
    """Return the loss of a generator: the scores of its pictures, negative."""
    return -fake.mean()


def gradient_penalty(critic: Critic, real: Tensor, fake: Tensor, draw: torch.Generator) -> Tensor:
    """Return the mean (|gradient| - 1)^2 of a critic between true and generated pictures.

    Args:
        critic: Without norms over the batch: each score is one picture's.
        real: (b, c, h, w).
        fake: (b, c, h, w).
        draw: Of the place between them, one for each picture; on the CPU.
    """
    share = torch.rand(len(real), 1, 1, 1, generator=draw).to(real.device)
    mixture = (share * real + (1 - share) * fake).detach().requires_grad_()
    (gradient,) = torch.autograd.grad(critic(mixture).sum(), mixture, create_graph=True)
    steepness = gradient.flatten(1).square().sum(1).clamp(min=LEAST_SQUARE).sqrt()
    return (steepness - 1).square().mean()


@dataclass(frozen=True, slots=True, kw_only=True)
class Wasserstein:
    """WGAN with a gradient penalty; fulfils `camkit.models_def.training.adversarial.game.Game`.

    Attributes:
        penalty: lambda of the penalty.
    """

    penalty: float

    def lesson(self, judge: Judge, real: Tensor, fake: Tensor, draw: torch.Generator) -> Terms:
        """Return the loss of a critic, and its penalty."""
        scores = _means_of(judge)
        return {
            "critic": (1.0, critic_loss(scores(real), scores(fake))),
            "penalty": (self.penalty, gradient_penalty(scores, real, fake, draw)),
        }

    def opinion(self, judge: Judge, real: Tensor, fake: Tensor) -> Tensor:
        """Return what the generator minimises."""
        del real
        return generator_loss(_means_of(judge)(fake))


def _means_of(judge: Judge) -> Critic:
    """Return one score a picture: the mean over all places."""
    return lambda pictures: judge(pictures).mean((1, 2, 3))
