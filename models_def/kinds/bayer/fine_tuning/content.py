"""The content loss of fine-tuning, eq. (6.12): pixels (`pixel_loss`) and features."""

import torch
from torch import Tensor

from camkit.models_def.training.adversarial.content import Features
from camkit.models_def.training.adversarial.views import Views


def perceptual_loss(views: Views, features: Features | None) -> Tensor:
    """Return the mean squared difference of features; of the sRGB values themselves without any.

    The thesis writes a norm; the mean square is what the cited source computes, and makes a weight
    mean the same for every size of patch.
    """
    phi = features or torch.Tensor.contiguous
    return (phi(views.seen) - phi(views.real)).square().mean()
