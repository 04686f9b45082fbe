"""The CPU-first family: what makes it exact under tiling, bounded and quick."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.networks.lean_unet import LEAN_L, LEAN_M, LEAN_S, LeanConfig, LeanUnet

CONFIGS = {"s": LEAN_S, "m": LEAN_M, "l": LEAN_L}
ALLOWED_LAYERS = {"LeanUnet", "ResidualBlock", "Upsampling", "Sequential", "ModuleList", "Conv2d"}


def _awake(config: LeanConfig, seed: int = 0) -> LeanUnet:
    """Make a network whose tail is not zero, as after training."""
    torch.manual_seed(seed)
    network = LeanUnet(config).eval()
    nn.init.normal_(network.tail.weight, std=0.05)
    return network


def _picture(side: int = 64, channels: int = 6, seed: int = 1) -> Tensor:
    return torch.rand(1, channels, side, side, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_new_network_returns_the_wiener_planes(config: LeanConfig) -> None:
    planes = _picture()
    assert torch.equal(LeanUnet(config)(planes), planes[:, 3:])


def test_new_network_of_one_picture_returns_it() -> None:
    planes = _picture(channels=3)
    assert torch.equal(LeanUnet(replace(LEAN_S, in_channels=3))(planes), planes)


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_network_without_bias_scales_with_its_input(config: LeanConfig) -> None:
    network, planes = _awake(config).double(), _picture().double()
    assert torch.allclose(network(256 * planes), 256 * network(planes), rtol=1e-12)


def test_bias_breaks_the_scaling() -> None:
    network = _awake(replace(LEAN_S, bias=True))
    for parameter in network.parameters():
        nn.init.normal_(parameter, std=0.1)
    planes = _picture()
    assert not torch.allclose(network(4 * planes), 4 * network(planes), rtol=1e-2)


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_only_convolutions_carry_parameters_and_no_statistics_are_taken(
    config: LeanConfig,
) -> None:
    assert {type(m).__name__ for m in LeanUnet(config).modules()} <= ALLOWED_LAYERS


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_every_convolution_but_the_head_reads_blocks_of_sixteen(config: LeanConfig) -> None:
    network = LeanUnet(config)
    convs = [m for m in network.modules() if isinstance(m, nn.Conv2d) and m is not network.head]
    assert all(conv.in_channels % 16 == 0 and conv.groups == 1 for conv in convs)
    assert network.head.in_channels < 8


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_signal_neither_dies_nor_explodes_in_a_new_network(config: LeanConfig) -> None:
    torch.manual_seed(2)
    network = LeanUnet(config)
    seen: list[Tensor] = []
    network.tail.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0].detach()))
    network(torch.randn(1, 6, 96, 96))
    assert 0.3 < float(seen[0].std()) < 10


def test_first_step_moves_the_tail_and_the_second_moves_everything() -> None:
    torch.manual_seed(3)
    network, planes = LeanUnet(LEAN_M), _picture()
    optimizer = torch.optim.SGD(network.parameters(), lr=0.1)
    before = {name: p.detach().clone() for name, p in network.named_parameters()}
    for _ in range(2):
        optimizer.zero_grad()
        torch.square(network(planes) - planes[:, :3]).mean().backward()
        optimizer.step()
    still = [name for name, p in network.named_parameters() if torch.equal(p, before[name])]
    assert still == []


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_shift_by_the_stride_shifts_the_output(config: LeanConfig) -> None:
    network = _awake(config).double()
    margin = 112
    side = 2 * margin + 2 * network.stride_px
    planes = _picture(side + network.stride_px).double()
    step = network.stride_px
    first = network(planes[..., :side, :side])[..., margin:-margin, margin:-margin]
    second = network(planes[..., step:, step:])
    inner = second[..., margin - step : -margin - step, margin - step : -margin - step]
    assert torch.allclose(first, inner, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"widths": (24, 32, 48, 64)}, "multiples of 16"),
        ({"widths": (16,)}, "multiples of 16"),
        ({"encoder_blocks": (1, 1)}, "need 3 encoder"),
        ({"middle_blocks": -1}, "must be >= 0"),
        ({"in_channels": 4}, "in_channels must be 3 or 6"),
    ],
)
def test_impossible_shape_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        replace(LEAN_M, **changes)  # type: ignore[arg-type]
