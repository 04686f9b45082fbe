"""The fusion network sees nine pixels about each, and both its inputs."""

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.fusion import FusionConfig, FusionNetwork

NARROW = FusionConfig(width=4, merged=4)


def test_a_pixel_sees_four_pixels_to_every_side_of_both_inputs():
    torch.manual_seed(0)
    network = FusionNetwork(NARROW)
    clean, lights = (torch.rand(1, 3, 21, 21, requires_grad=True) for _ in range(2))
    network(clean, lights)[0, :, 10, 10].sum().backward()
    for given in (clean, lights):
        seen = given.grad.abs().sum((0, 1)).nonzero()
        assert seen.min(0).values.tolist() == [6, 6]
        assert seen.max(0).values.tolist() == [14, 14]


def test_the_result_lies_between_black_and_256():
    network = FusionNetwork(NARROW)
    planes = torch.rand(1, 3, 8, 8)
    torch.nn.init.constant_(network.merge[1][0].bias, 1e4)
    assert network(planes, planes).unique().tolist() == [256]
    torch.nn.init.constant_(network.merge[1][0].bias, -1e4)
    assert network(planes, planes).unique().tolist() == [0]


def test_impossible_widths_are_refused():
    with pytest.raises(ContractError, match="must be positive; got 0, 4"):
        FusionConfig(width=0, merged=4)
