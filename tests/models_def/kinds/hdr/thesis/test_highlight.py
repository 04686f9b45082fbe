"""The highlight U-Net: shapes of table 5.2, its range, and its refusals."""

import pytest
import torch
from torch import nn

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.highlight import HighlightConfig, HighlightUnet
from camkit.models_def.kinds.hdr.thesis.layers import InstanceNorm

NARROW = HighlightConfig(widths=(4, 6, 8))


def test_kernels_and_channels_are_those_of_the_table():
    convs = [
        (m.in_channels, m.out_channels, m.kernel_size[0])
        for name in ("encoders", "ups", "decoders", "last")
        for m in getattr(HighlightUnet(), name).modules()
        if isinstance(m, nn.Conv2d)
    ]
    assert convs[:10] == [
        *((3, 32, 7), (32, 32, 3), (32, 64, 3), (64, 64, 3), (64, 128, 3), (128, 128, 3)),
        *((128, 256, 3), (256, 256, 3), (256, 512, 3), (512, 512, 3)),
    ]
    assert convs[10:14] == [(64, 32, 3), (128, 64, 3), (256, 128, 3), (512, 256, 3)]
    assert convs[14:] == [
        *((64, 32, 3), (32, 32, 3), (128, 64, 3), (64, 64, 3)),
        *((256, 128, 3), (128, 128, 3), (512, 256, 3), (256, 256, 3), (32, 3, 1)),
    ]


def test_the_last_three_layers_have_no_norm():
    network = HighlightUnet(NARROW)
    assert sum(isinstance(m, InstanceNorm) for m in network.modules()) == 2 * 3 + 2
    assert not any(isinstance(m, InstanceNorm) for m in network.decoders[0].modules())


def test_lights_lie_between_white_and_256():
    network = HighlightUnet(NARROW)
    streaks = torch.rand(2, 3, 16, 24)
    for bias, wanted in ((-1e4, 1.0), (1e4, 256.0)):
        nn.init.constant_(network.last.bias, bias)
        lights = network(streaks)
        assert lights.shape == streaks.shape
        assert lights.unique().tolist() == [wanted]


def test_every_layer_learns():
    network = HighlightUnet(NARROW)
    (network(torch.rand(1, 3, 16, 16)) - 3).square().mean().backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in network.parameters())


@pytest.mark.parametrize("widths", [(4,), (4, 0)])
def test_impossible_widths_are_refused(widths):
    with pytest.raises(ContractError, match="two or more positive integers"):
        HighlightConfig(widths=widths)
