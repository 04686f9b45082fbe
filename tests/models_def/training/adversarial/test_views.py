"""Output and truth are seen as a display shows them."""

import numpy as np
import pytest
import torch

from camkit.colorimetry import encode_srgb
from camkit.models_def.training.adversarial.views import make_views, pixel_loss, to_display

EYE = torch.eye(3)


def views(output, target, weight=None):
    return make_views(output, target, torch.ones(1, 3) if weight is None else weight, EYE)


def test_display_is_srgb_of_the_matrix_of_the_squared_plane():
    root = torch.linspace(-0.1, 1.3, 48).reshape(1, 3, 4, 4)
    matrix = torch.tensor([[1.4, -0.3, -0.1], [-0.2, 1.3, -0.1], [0.0, -0.4, 1.4]])
    linear = matrix.numpy() @ np.square(root.clamp(min=0).numpy()).reshape(3, -1)
    expected = encode_srgb(linear.reshape(1, 3, 4, 4).astype(np.float32))
    assert np.allclose(to_display(root, matrix).numpy(), expected, atol=1e-6)


def test_gradients_are_finite_at_black_and_beyond_white():
    root = torch.tensor([-0.5, 0.0, 1e-8, 0.03, 1.0, 2.0]).reshape(1, 1, 1, 6).repeat(1, 3, 1, 1)
    root.requires_grad_(requires_grad=True)
    to_display(root, EYE).sum().backward()
    assert torch.isfinite(root.grad).all()


def test_pixel_loss_is_the_mean_over_judged_pixels_in_the_square_root_domain():
    output = torch.tensor([0.5, 0.9, 0.2, 0.4]).reshape(1, 1, 2, 2).repeat(1, 3, 1, 1)
    target = torch.tensor([0.4, -1.0, 0.2, 0.7]).reshape(1, 1, 2, 2).repeat(1, 3, 1, 1)
    weight = torch.tensor([[2.0, 2.0, 2.0]])
    assert pixel_loss(views(output, target, weight)).item() == pytest.approx(2 * 0.4 / 3)
