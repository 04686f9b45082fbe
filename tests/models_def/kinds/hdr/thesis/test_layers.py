"""Norms by their closed forms; a clip that lets gradients pass."""

import torch

from camkit.models_def.kinds.hdr.thesis.layers import InstanceNorm, ScaledNorm, clip, instance_norm


def test_instance_norm_is_that_of_torch():
    x = 3 * torch.randn(2, 4, 5, 7) + 1
    assert torch.allclose(instance_norm(x), torch.nn.functional.instance_norm(x), atol=1e-5)


def test_a_channel_of_one_pixel_becomes_zero():
    assert torch.equal(instance_norm(torch.rand(2, 3, 1, 1)), torch.zeros(2, 3, 1, 1))


def test_scaled_norm_is_the_identity_at_first_and_then_eq_nm():
    norm, x = ScaledNorm(), torch.randn(1, 2, 4, 4)
    assert torch.equal(norm(x), x)
    with torch.no_grad():
        norm.plain.fill_(0.5)
        norm.normed.fill_(2.0)
    assert torch.allclose(norm(x), 0.5 * x + 2 * instance_norm(x))


def test_instance_norm_of_a_table_has_gain_and_offset_of_each_channel():
    norm, x = InstanceNorm(2), torch.randn(3, 2, 4, 4)
    with torch.no_grad():
        norm.gain.copy_(torch.tensor([1.0, 3.0]))
        norm.offset.copy_(torch.tensor([0.0, 5.0]))
    mean, deviation = norm(x).mean(dim=(2, 3)), norm(x).std(dim=(2, 3), correction=0)
    assert torch.allclose(mean, torch.tensor([0.0, 5.0]).expand(3, 2), atol=1e-5)
    assert torch.allclose(deviation, torch.tensor([1.0, 3.0]).expand(3, 2), atol=1e-3)


def test_a_clip_cuts_values_exactly_and_no_gradients():
    x = torch.tensor([-3e9, -0.5, 0.5, 300.0], requires_grad=True)
    clipped = clip(x, 0, 256)
    assert clipped.tolist() == [0, 0, 0.5, 256]
    (clipped * torch.tensor([1.0, 2.0, 3.0, 4.0])).sum().backward()
    assert x.grad.tolist() == [1, 2, 3, 4]
