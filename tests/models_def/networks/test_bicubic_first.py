"""SRCNN and VDSR on the bicubic picture."""

import pytest
import torch
from torch import nn
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import Bicubic
from camkit.models_def.networks.bicubic_first import Srcnn, SrcnnConfig, Vdsr, VdsrConfig


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


def test_impossible_shapes_of_srcnn_are_refused() -> None:
    with pytest.raises(ContractError, match="three odd sides"):
        SrcnnConfig(kernels_px=(9, 4, 5))
    with pytest.raises(ContractError, match="in_channels"):
        SrcnnConfig(in_channels=0)


def test_it_has_twenty_layers_and_their_parameters() -> None:
    network = Vdsr(VdsrConfig())
    assert len(network.layers) == 20
    inner = 18 * (9 * 64 * 64 + 64)
    assert sum(p.numel() for p in network.parameters()) == inner + 2 * 9 * 64 + 64 + 1


def test_a_new_one_is_bicubic_and_a_trained_one_is_not() -> None:
    network, planes = Vdsr(VdsrConfig(layers=4, width=8, in_channels=2)), torch.rand(1, 2, 6, 8)
    fine = Bicubic()(planes[:, :1])
    assert torch.equal(network(planes), fine)
    last = network.layers[-1]
    assert isinstance(last, nn.Conv2d)
    nn.init.normal_(last.weight)
    assert not torch.allclose(network(planes), fine, atol=1e-2)


def test_impossible_shapes_of_vdsr_are_refused() -> None:
    with pytest.raises(ContractError, match="layers must be >= 2"):
        VdsrConfig(layers=1)
