"""The generator is the trimmed U-Net with deep scales that start at zero."""

import pytest
import torch
from torch import nn

from camkit.errors import ContractError
from camkit.models_def.networks.full_unet import FullConfig, FullUnet, start_from_trimmed
from camkit.models_def.networks.trimmed_unet import TrimmedConfig, TrimmedUnet

NARROW = FullConfig(widths=(4, 6, 8, 8, 8, 8, 8))
TRIMMED = TrimmedConfig(widths=(4, 6, 8))


def test_seven_scales_with_six_poolings_and_six_upsamplings(monkeypatch) -> None:
    pooled: list[torch.Size] = []
    pool = nn.functional.max_pool2d

    def counted(x: torch.Tensor, size: int) -> torch.Tensor:
        pooled.append(x.shape[-2:])
        return pool(x, size)

    monkeypatch.setattr(nn.functional, "max_pool2d", counted)
    network = FullUnet(NARROW)
    assert network(torch.zeros(1, 6, 128, 64)).shape == (1, 3, 128, 64)
    assert pooled == [(128 >> i, 64 >> i) for i in range(6)]
    assert len(network.deep.ups) + 2 == 6
    assert network.stride_px == 64


def test_started_from_a_trimmed_network_it_first_computes_the_same() -> None:
    torch.manual_seed(1)
    trimmed, network = TrimmedUnet(TRIMMED), FullUnet(NARROW)
    planes = torch.rand(1, 6, 64, 128)
    assert not torch.allclose(network(planes), trimmed(planes))
    start_from_trimmed(network, trimmed.state_dict())
    assert torch.equal(network(planes), trimmed(planes))


def test_every_tensor_of_the_trimmed_network_is_copied_and_named() -> None:
    torch.manual_seed(2)
    trimmed, network = TrimmedUnet(TRIMMED), FullUnet(NARROW)
    before = {name: t.clone() for name, t in network.state_dict().items()}
    copied = start_from_trimmed(network, trimmed.state_dict())
    state = network.state_dict()
    assert sorted(copied) == sorted(n for n in state if n.startswith("outer."))
    for name, tensor in trimmed.state_dict().items():
        assert torch.equal(state[f"outer.{name}"], tensor)
    assert all(torch.equal(state[n], before[n]) for n in state if n not in copied)


def test_deep_scales_learn_from_the_first_steps() -> None:
    torch.manual_seed(3)
    network = FullUnet(NARROW)
    optimizer = torch.optim.SGD(network.parameters(), lr=0.1)
    for _ in range(2):
        optimizer.zero_grad()
        (network(torch.rand(1, 6, 64, 64)) - 1).square().mean().backward()
        optimizer.step()
    silent = [n for n, p in network.named_parameters() if p.grad is None or not p.grad.any()]
    assert silent == []


def test_weights_of_other_widths_are_refused() -> None:
    other = TrimmedUnet(TrimmedConfig(widths=(4, 6, 16)))
    with pytest.raises(ContractError, match=r"trimmed U-Net of widths \(4, 6, 8\) and 6 planes"):
        start_from_trimmed(FullUnet(NARROW), other.state_dict())


@pytest.mark.parametrize("widths", [(32, 64, 128), (8,) * 6 + (0,)])
def test_impossible_widths_are_refused(widths: tuple[int, ...]) -> None:
    with pytest.raises(ContractError, match="7 positive integers"):
        FullConfig(widths=widths)
