"""VDSR: a correction of the bicubic picture."""

import pytest
import torch
from torch import nn

from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import Bicubic
from camkit.models_def.networks.vdsr import Vdsr, VdsrConfig


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


def test_impossible_shapes_are_refused() -> None:
    with pytest.raises(ContractError, match="layers must be >= 2"):
        VdsrConfig(layers=1)
