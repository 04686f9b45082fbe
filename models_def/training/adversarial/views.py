"""Output and truth of a batch as a display shows them.

Networks work on stabilised planes. Features and discriminators were made for, or judge, pictures
that people look at; so planes become linear light, Rec.709 and sRGB first. The pixel term stays in
the square-root domain of `losses`, unclipped, so that highlights count too.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from camkit.models_def.sensors.tone import encode_srgb


@dataclass(frozen=True, slots=True, kw_only=True)
class Views:
    """Output and truth of a batch; where nothing can be known, the truth is the output itself.

    Attributes:
        output: (b, 3, h, w) square-root domain.
        target: Likewise.
        judged: (b, 3, h, w) bool.
        fake: (b, 3, h, w) sRGB of the output, in 0..1.
        real: Likewise of the target.
    """

    output: Tensor
    target: Tensor
    judged: Tensor
    fake: Tensor
    real: Tensor


def make_views(output: Tensor, target: Tensor, weight: Tensor, to_rec709: Tensor) -> Views:
    """Prepare a batch for the losses.

    Args:
        output: (b, 3, h, w) stabilised.
        target: (b, 3, h, w) stabilised; negative where nothing can be known.
        weight: (b, 3) scale * sqrt(shot) per colour, to the square-root domain.
        to_rec709: (3, 3) white-balanced camera colours to linear Rec.709.
    """
    judged = target >= 0
    root = output * weight[:, :, None, None]
    true = torch.where(judged, target * weight[:, :, None, None], root.detach())
    return Views(
        output=root,
        target=true,
        judged=judged,
        fake=to_display(root, to_rec709),
        real=to_display(true, to_rec709).detach(),
    )


def to_display(root: Tensor, to_rec709: Tensor) -> Tensor:
    """Return (b, 3, h, w) sRGB in 0..1 from the square-root domain.

    The small constant read_variance / shot under the root is left in: it is the same on both sides.
    """
    light = root.clamp(min=0).square()
    linear = torch.einsum("ij,bjhw->bihw", to_rec709, light).clamp(0, 1)
    return encode_srgb(linear)


def pixel_loss(views: Views) -> Tensor:
    """Return the mean |difference| over what can be judged, in the square-root domain."""
    gap = (views.output - views.target).abs()
    return gap.sum() / views.judged.sum().clamp(min=1)
