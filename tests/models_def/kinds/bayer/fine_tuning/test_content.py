"""Output and truth are compared as they are seen; what cannot be known pulls nowhere."""

import pytest
import torch

from camkit.models_def.kinds.bayer.fine_tuning.content import perceptual_loss
from camkit.models_def.training.adversarial.views import make_views, pixel_loss, to_display

EYE = torch.eye(3)


def views(output, target):
    return make_views(output, target, torch.ones(1, 3), EYE)


def test_unknown_pixels_have_no_gradient():
    output = torch.rand(1, 3, 8, 8, requires_grad=True)
    target = torch.rand(1, 3, 8, 8)
    target[..., :4] = -1
    seen = views(output, target)
    (pixel_loss(seen) + perceptual_loss(seen, None)).backward()
    assert (output.grad[..., :4] == 0).all()
    assert (output.grad[..., 4:] != 0).any()


def test_without_features_the_perceptual_term_compares_srgb_values():
    output, target = torch.rand(1, 3, 8, 8), torch.rand(1, 3, 8, 8)
    seen = views(output, target)
    expected = torch.mean((to_display(output, EYE) - to_display(target, EYE)) ** 2)
    assert perceptual_loss(seen, None).item() == pytest.approx(expected.item())
    doubled = perceptual_loss(seen, lambda x: 2 * x).item()
    assert doubled == pytest.approx(4 * expected.item())
