"""The splitting network: the early 1x1 equals the hypercolumn; what it gives at first."""

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.splitting import SplittingConfig, SplittingNetwork

NARROW = {"width": 6, "dilations": (1, 2), "vgg_widths": (4, 6, 8, 8, 8)}


def awake(config):
    """Make a network whose last layer is not zero, as after training."""
    torch.manual_seed(1)
    network = SplittingNetwork(config).eval()
    torch.nn.init.normal_(network.last.weight, std=0.1)
    return network


def pair(**config):
    """Give the naive and the early network of the same weights."""
    naive = awake(SplittingConfig(early=False, **config))
    early = SplittingNetwork(SplittingConfig(**config)).eval()
    early.load_state_dict(naive.state_dict())
    return naive, early


def test_early_1x1_equals_the_hypercolumn_of_1475_channels():
    naive, early = pair()
    assert naive.config.hypercolumn == 1475
    capture = torch.rand(1, 3, 32, 48)
    with torch.no_grad():
        levels = (capture, *naive.vgg(capture))
        column, compressed = naive._naive(levels), early._compressed(levels)
        wanted, found = naive(capture), early(capture)
    assert column.abs().mean() > 0.1
    assert (column - compressed).abs().max() <= 1e-4 * column.abs().max()
    for one, other in zip(wanted, found, strict=True):
        assert (one - other).abs().max() <= 1e-4
    assert not torch.equal(found[0], capture)


def test_gradients_of_both_orders_agree():
    grads = []
    for network in pair(**NARROW):
        clean, streaks = network(torch.linspace(0, 1, 3 * 16 * 32).reshape(1, 3, 16, 32))
        (clean + streaks).square().mean().backward()
        grads.append(network.compress.weight.grad)
    assert torch.allclose(*grads, atol=1e-6)
    assert grads[0].abs().max() > 0


def test_a_new_network_gives_the_capture_cut_at_white_and_no_streaks():
    capture = 2 * torch.rand(2, 3, 32, 16)
    clean, streaks = SplittingNetwork(SplittingConfig(**NARROW))(capture)
    assert torch.equal(clean, capture.clamp(max=1))
    assert torch.equal(streaks, torch.zeros_like(capture))


def test_streaks_end_at_16_and_the_picture_at_white():
    network = awake(SplittingConfig(**NARROW))
    torch.nn.init.constant_(network.last.bias, 100.0)
    clean, streaks = network(torch.rand(1, 3, 16, 16))
    assert clean.unique().tolist() == [1]
    assert streaks.unique().tolist() == [16]


def test_the_receptive_field_of_the_dilated_layers_is_that_of_the_table():
    network = SplittingNetwork(SplittingConfig(width=2, vgg_widths=(2, 2, 2, 2, 2)))
    for block in network.dilated:
        torch.nn.init.constant_(block[0].weight, 0.1)
    column = torch.zeros(1, 2, 1, 300, requires_grad=True)
    network.dilated(column)[0, :, 0, 150].sum().backward()
    reached = column.grad[0, :, 0].abs().sum(0).nonzero()[:, 0]
    assert (int(reached.min()), int(reached.max())) == (150 - 128, 150 + 128)


def test_vgg_is_not_trained():
    network = awake(SplittingConfig(**NARROW))
    network(torch.rand(1, 3, 16, 16))[1].sum().backward()
    assert all(p.grad is None for p in network.vgg.parameters())
    assert network.compress.weight.grad.abs().max() > 0


@pytest.mark.parametrize("wrong", [{"width": 0}, {"dilations": ()}, {"dilations": (1, 0)}])
def test_impossible_shapes_are_refused(wrong):
    with pytest.raises(ContractError, match="width and dilations >= 1"):
        SplittingConfig(**wrong)
