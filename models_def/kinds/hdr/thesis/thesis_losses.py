"""The losses of the thesis, eqs. (5.6) to (5.11), as pure functions of linear light.

Where the thesis writes a norm over a picture, the mean is taken, as the sources it cites do: a
weight then means the same for every size of patch. Weights it does not give: those of the layers
are of the source of the splitting network; alpha and beta are settings of a recipe.

References: Sun 2021, section 5.4.1; Zhang, Ng and Chen 2018.
"""

from collections.abc import Sequence
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError

LAYER_WEIGHTS: Final = (1 / 4.8, 1 / 3.7, 1 / 5.6)
"""nu of conv2_2, conv3_2, conv4_2, as Zhang, Ng and Chen 2018 have them."""
GAMMA: Final = 0.5
EPSILON: Final = 1e-3
"""Of eq. (5.11), whose value the thesis does not give."""
HUBER: Final = 1.0
_LEAST_NORM: Final = 1e-6


def perceptual_loss(
    output: Sequence[Tensor], truth: Sequence[Tensor], weights: Sequence[float] = LAYER_WEIGHTS
) -> Tensor:
    """Return the weighted mean |difference| of features, eq. (5.7).

    Args:
        output: (b, c, h, w) features of each layer, of what a network gave.
        truth: Likewise, of what it should give.
        weights: nu of each layer.

    Raises:
        ContractError: If the layers are not as many as the weights.
    """
    if not len(output) == len(truth) == len(weights) > 0:
        raise ContractError(
            f"features of {len(weights)} layers are compared; got {len(output)}, {len(truth)}"
        )
    terms = [
        weight * (one - other).abs().mean()
        for one, other, weight in zip(output, truth, weights, strict=True)
    ]
    return torch.stack(terms).sum()


def exclusion_loss(clean: Tensor, streaks: Tensor) -> Tensor:
    """Return the overlap of the edges of two layers of a picture, eq. (5.8).

    Gradients are differences to the next pixel, along x and y each. The Frobenius norm is taken
    over both and divided by the root of their number; the mean over the batch comes back.

    Args:
        clean: (b, c, h, w) I_U.
        streaks: (b, c, h, w) I_r.
    """
    first, second = _norms(clean), _norms(streaks)
    ratio = (second / first).sqrt()[:, None]
    one, other = _gradients(clean), _gradients(streaks)
    joint = torch.tanh(ratio * one) * torch.tanh(other / ratio)
    return (joint.square().mean(dim=1) + _LEAST_NORM**2).sqrt().mean()


def unsaturated_loss(
    perceptual: Tensor, exclusion: Tensor, *, perceptual_weight: float, exclusion_weight: float
) -> Tensor:
    """Return L_U = alpha_1 L_VGG + alpha_2 L_excl, eq. (5.9)."""
    return perceptual_weight * perceptual + exclusion_weight * exclusion


def saturated_loss(perceptual: Tensor, *, weight: float) -> Tensor:
    """Return L_S = beta L_VGG of the lights, eq. (5.10)."""
    return weight * perceptual


def fused_loss(fused: Tensor, truth: Tensor) -> Tensor:
    """Return the Huber loss of roots, eq. (5.11), whose first I lacks its index F.

    Args:
        fused: (b, c, h, w) I_F, >= 0.
        truth: (b, c, h, w) I, >= 0.
    """
    one, other = ((x + EPSILON) ** GAMMA for x in (fused, truth))
    return torch.nn.functional.huber_loss(one, other, delta=HUBER)


def total_loss(unsaturated: Tensor, saturated: Tensor, fused: Tensor) -> Tensor:
    """Return L_total = L_U + L_S + L_F, eq. (5.6)."""
    return unsaturated + saturated + fused


def _norms(planes: Tensor) -> Tensor:
    """Return (b,) Frobenius norms; the root of an exact zero has no gradient."""
    return (planes.flatten(1).square().sum(dim=1) + _LEAST_NORM**2).sqrt()


def _gradients(planes: Tensor) -> Tensor:
    """Return (b, n) |differences| to the right and lower neighbour."""
    across = planes[..., :, 1:] - planes[..., :, :-1]
    down = planes[..., 1:, :] - planes[..., :-1, :]
    return torch.cat([across.flatten(1), down.flatten(1)], dim=1).abs()
