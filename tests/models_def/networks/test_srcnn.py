"""SRCNN on the bicubic picture."""

import pytest
import torch
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import Bicubic
from camkit.models_def.networks.srcnn import Srcnn, SrcnnConfig


@pytest.mark.parametrize(("kernels", "count"), [((9, 1, 5), 8_129), ((9, 5, 5), 57_281)])
def test_it_has_the_parameters_of_the_paper(kernels: tuple[int, ...], count: int) -> None:
    network = Srcnn(SrcnnConfig(kernels_px=kernels))
    assert sum(p.numel() for p in network.parameters()) == count


def test_it_is_three_convolutions_on_the_bicubic_picture() -> None:
    torch.manual_seed(2)
    network = Srcnn(SrcnnConfig(phase=1))
    planes = torch.rand(1, 1, 6, 8)
    first, second, third = network.layers
    x = Bicubic(4, 1)(planes)
    x = functional.relu(first(x))
    expected = third(functional.relu(second(x)))
    assert torch.allclose(network(planes), expected)
    assert expected.shape == (1, 1, 24, 32)


def test_impossible_shapes_are_refused() -> None:
    with pytest.raises(ContractError, match="three odd sides"):
        SrcnnConfig(kernels_px=(9, 4, 5))
    with pytest.raises(ContractError, match="in_channels"):
        SrcnnConfig(in_channels=0)
