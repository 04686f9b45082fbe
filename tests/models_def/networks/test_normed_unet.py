"""The generator of chapter 3: six stages, its widths, and what it is given."""

import pytest
import torch
from torch import nn

from camkit.errors import ContractError
from camkit.models_def.networks.instance_norm import live_norms
from camkit.models_def.networks.normed_unet import NormedConfig, NormedUnet

NARROW = NormedConfig(width=4)


def _conv(inputs: int, outputs: int, side: int) -> int:
    return inputs * outputs * side**2 + outputs


def test_widths_of_the_thesis_double_up_to_512_in_six_stages() -> None:
    network = NormedUnet()
    assert network.config.widths == (64, 128, 256, 512, 512, 512)
    halving = [m for m in network.modules() if isinstance(m, nn.Conv2d) and m.stride == (2, 2)]
    assert [m.kernel_size for m in halving] == [(4, 4)] * 6
    assert network.stride_px == 64


@pytest.mark.parametrize("width", [16, 64])
def test_parameters_are_those_counted_by_hand(width: int) -> None:
    a, b, c, d = (width * 2**i for i in range(4))
    down = _conv(6, a, 3) + _conv(a, a, 4) + _conv(a, b, 4) + _conv(b, c, 4) + _conv(c, d, 4)
    down += 2 * _conv(d, d, 4)
    up = _conv(d, d, 3) + _conv(2 * d, d, 3) + _conv(2 * d, c, 3) + _conv(2 * c, b, 3)
    up += _conv(2 * b, a, 3) + _conv(2 * a, a, 3) + _conv(a, 3, 3)
    slopes = 1 + 5 + 5 + 2
    network = NormedUnet(NormedConfig(width=width))
    assert sum(p.numel() for p in network.parameters()) == down + up + slopes


def test_norms_are_live_everywhere_but_at_the_ends() -> None:
    found = live_norms(NormedUnet(NARROW))
    assert found == tuple(f"{side}.{i}.2" for side in ("downs", "ups") for i in range(5))
    assert live_norms(NormedUnet(NormedConfig(width=4, frozen=True))) == ()


def test_a_new_one_gives_the_planes_that_it_corrects() -> None:
    planes = torch.rand(1, 6, 64, 128)
    assert torch.equal(NormedUnet(NARROW)(planes), planes[:, 3:])
    alone = NormedUnet(NormedConfig(width=4, capture_only=True))
    assert torch.equal(alone(planes), planes[:, :3])
    nothing = NormedUnet(NormedConfig(width=4, residual=False))(planes)
    assert nothing.shape == (1, 3, 64, 128)
    assert not torch.allclose(nothing, planes[:, 3:], atol=0.05)


def test_the_thesis_form_sees_the_capture_alone() -> None:
    torch.manual_seed(1)
    network = NormedUnet(NormedConfig(width=4, capture_only=True, residual=False))
    planes = torch.rand(1, 6, 64, 64)
    other = torch.cat([planes[:, :3], torch.rand(1, 3, 64, 64)], dim=1)
    assert torch.equal(network(planes), network(other))


def test_every_weight_learns_after_the_first_steps() -> None:
    torch.manual_seed(3)
    network = NormedUnet(NARROW)
    optimizer = torch.optim.SGD(network.parameters(), lr=0.1)
    for _ in range(2):
        optimizer.zero_grad()
        (network(torch.rand(1, 6, 128, 128)) - 1).square().mean().backward()
        optimizer.step()
    # A norm takes away what the bias before it adds.
    weights = [(n, p) for n, p in network.named_parameters() if not n.endswith("bias")]
    assert [n for n, p in weights if p.grad is None or not p.grad.any()] == []


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(ContractError, match="width >= 1 and stages >= 2"):
        NormedConfig(width=0)
    with pytest.raises(ContractError, match="in_channels must be 3 or 6"):
        NormedConfig(in_channels=4)
