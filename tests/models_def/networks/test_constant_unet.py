"""The single-stage U-Net: five scales of one width, and what it refuses."""

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.networks.constant_unet import ConstantConfig, ConstantUnet


def test_five_scales_of_the_same_width():
    network = ConstantUnet()
    assert network.stride_px == 16
    assert {m.out_channels for m in network.modules() if isinstance(m, torch.nn.Conv2d)} == {
        64,
        4 * 64,
        3,
    }


def test_a_picture_of_roots_may_become_brighter_than_it_was():
    network = ConstantUnet(ConstantConfig(width=4, scales=3, in_channels=3))
    torch.nn.init.constant_(network.out.bias, 16.0)
    assert network(torch.rand(1, 3, 8, 16)).mean() > 8


def test_every_layer_learns():
    torch.manual_seed(0)
    network = ConstantUnet(ConstantConfig(width=4, scales=3))
    (network(torch.rand(1, 6, 16, 16)) - 1).square().mean().backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in network.parameters())


@pytest.mark.parametrize("wrong", [{"width": 0}, {"scales": 1}, {"in_channels": 4}])
def test_impossible_shapes_are_refused(wrong):
    with pytest.raises(ContractError, match=r"width >= 1|in_channels"):
        ConstantConfig(**wrong)
