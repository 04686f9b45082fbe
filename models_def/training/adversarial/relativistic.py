"""The relativistic average least-squares losses (RaGAN-LS).

Eq. (6.13) of the thesis prints both terms with D - E[(D - 1)^2], the same for both players; as
such it rewards nothing. The cited source (Kupyn et al. 2019, after Jolicoeur-Martineau 2018) has

    discriminator  1/2 E[(D(x) - E D(G(z)) - 1)^2] + 1/2 E[(D(G(z)) - E D(x) + 1)^2]
    generator      1/2 E[(D(x) - E D(G(z)) + 1)^2] + 1/2 E[(D(G(z)) - E D(x) - 1)^2]

which is what these functions compute. The expectations run over the batch and all places; the
source takes those inside the squares over a history of 50 pictures, since its batch is 1.
"""

import torch
from torch import Tensor

from camkit.models_def.training.adversarial.game import Judge, Terms


def discriminator_loss(real: Tensor, fake: Tensor) -> Tensor:
    """Return the scalar that a discriminator minimises: real scores one above restored ones.

    Args:
        real: Scores of true pictures, any shape.
        fake: Scores of restored pictures.
    """
    above_fake = (real - fake.mean() - 1).square().mean()
    below_real = (fake - real.mean() + 1).square().mean()
    return 0.5 * (above_fake + below_real)


def generator_loss(real: Tensor, fake: Tensor) -> Tensor:
    """Return scalar that a generator minimises: the discriminator's with the players swapped."""
    return discriminator_loss(fake, real)


class Relativistic:
    """RaGAN-LS; fulfils `camkit.models_def.training.adversarial.game.Game`."""

    def lesson(self, judge: Judge, real: Tensor, fake: Tensor, draw: torch.Generator) -> Terms:
        """Return the loss of a discriminator."""
        del draw
        return {"discriminator": (1.0, discriminator_loss(judge(real), judge(fake)))}

    def opinion(self, judge: Judge, real: Tensor, fake: Tensor) -> Tensor:
        """Return what the generator minimises."""
        return generator_loss(judge(real), judge(fake))
