"""Output and truth compared by |difference|, Gram matrices and features.

References: Sun 2021, eqs. (3.6), (3.7), (6.12).

Features are those behind the ReLU of conv3_2 of VGG-19; fine-tuning has those before the ReLU of
conv3_3. Without a file of its weights the layers up to conv3_2 stand in for it, four times
narrower, with random weights that are the same each time: their Gram matrices see texture and
colour, but nothing that was learned from photographs.

References: Sun 2021, section 3.5.2; Gatys, Ecker and Bethge 2016; Johnson et al. 2016.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.networks.vgg import WIDTHS, VggLevels, take_vgg
from camkit.models_def.training.adversarial.game import Terms
from camkit.models_def.training.adversarial.views import Views, pixel_loss
from camkit.models_def.training.recipe import ContentRecipe

Features = Callable[[Tensor], Tensor]
"""(b, 3, h, w) sRGB in 0..1 -> (b, c, m, n)."""

BLOCKS: Final = 3
SUBSTITUTE_WIDTHS: Final = tuple(width // 4 for width in WIDTHS[:BLOCKS])


class Relu32(torch.nn.Module):
    """Features behind the ReLU of conv3_2, a quarter of the size of a picture."""

    def __init__(self, vgg: Path | None) -> None:
        """Read the weights of VGG-19; None takes the substitute.

        Raises:
            ContractError: If the file is no VGG-19 of torchvision.
        """
        super().__init__()
        widths = SUBSTITUTE_WIDTHS if vgg is None else WIDTHS[:BLOCKS]
        self.levels = VggLevels(blocks=BLOCKS, widths=widths, pooling="max")
        if vgg is not None:
            take_vgg(self.levels, vgg)

    def forward(self, picture: Tensor) -> Tensor:
        """Return (b, c, h / 4, w / 4) from (b, 3, h, w) sRGB in 0..1."""
        features: Tensor = self.levels(picture)[-1]
        return features


class Conv33(torch.nn.Module):
    """Features before the ReLU of conv3_3, a quarter of the size of a picture."""

    def __init__(self, vgg: Path) -> None:
        """Read the weights of VGG-19.

        Raises:
            ContractError: If the file is no VGG-19 of torchvision.
        """
        super().__init__()
        self.levels = VggLevels(blocks=BLOCKS, pooling="max", next_one=True)
        take_vgg(self.levels, vgg)

    def forward(self, picture: Tensor) -> Tensor:
        """Return (b, 256, h / 4, w / 4) from (b, 3, h, w) sRGB in 0..1."""
        features: Tensor = self.levels(picture)[-1]
        return features


def gram(features: Tensor) -> Tensor:
    """Return the (b, c, c) Gram matrices of (b, c, h, w) features, eq. (3.6)."""
    flat = features.flatten(2)
    return flat @ flat.transpose(1, 2) / (flat.shape[1] * flat.shape[2])


def gram_loss(fake: Tensor, real: Tensor) -> Tensor:
    """Return the 1-norm of the difference of Gram matrices, eq. (3.7); the mean over the batch."""
    return (gram(fake) - gram(real)).abs().sum((1, 2)).mean()


def content_terms(views: Views, recipe: ContentRecipe, features: Features | None) -> Terms:
    """Return the terms that count.

    Args:
        views: Output and truth.
        recipe: Weights.
        features: Looked through; may be None where `recipe.looks` is false.
    """
    terms = {"l1": (recipe.l1_weight, pixel_loss(views))} if recipe.l1_weight else {}
    if features is None or not recipe.looks:
        return terms
    with torch.no_grad():
        real = features(views.real)
    fake = features(views.fake)
    if recipe.gram_weight:
        terms["gram"] = recipe.gram_weight, gram_loss(fake, real)
    if recipe.feature_weight:
        terms["features"] = recipe.feature_weight, (fake - real).square().mean()
    return terms
