"""The network without activation functions is that of its publication."""

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.networks.nafnet import ChannelNorm, NafBlock, NafConfig, Nafnet

SMALL = NafConfig(width=4, encoder_blocks=(1, 2), decoder_blocks=(1, 1))


def _parameters(config: NafConfig) -> int:
    """Count by formula: a block has 7 c^2 + 33 c, a step down 8 c^2 + 2 c, a step up 8 c^2."""
    widths = [config.width * 2**scale for scale in range(len(config.encoder_blocks) + 1)]
    counts = [*config.encoder_blocks, config.middle_blocks]
    counts = [a + b for a, b in zip(counts, (*reversed(config.decoder_blocks), 0), strict=True)]
    blocks = sum(n * (7 * c * c + 33 * c) for n, c in zip(counts, widths, strict=True))
    steps = sum(16 * c * c + 2 * c for c in widths[:-1])
    return blocks + steps + config.width * 9 * (config.in_channels + 3) + config.width + 3


@pytest.mark.parametrize("config", [NafConfig(), SMALL])
def test_parameters_follow_the_formula(config: NafConfig) -> None:
    assert sum(p.numel() for p in Nafnet(config).parameters()) == _parameters(config)


def test_the_published_network_has_its_17_11_million_parameters() -> None:
    config = NafConfig(width=32, encoder_blocks=(1, 1, 1, 28), in_channels=3)
    with torch.device("meta"):
        network = Nafnet(config)
    assert sum(p.numel() for p in network.parameters()) == _parameters(config) == 17_111_907


def test_a_new_network_returns_its_last_planes_and_a_changed_one_has_gradients() -> None:
    torch.manual_seed(1)
    network, planes = Nafnet(SMALL), torch.rand(2, 6, 16, 24)
    assert torch.equal(network(planes), planes[:, -3:] + network.ending.bias[:, None, None])
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    network(planes).square().mean().backward()
    assert all(p.grad is not None and bool(p.grad.any()) for p in network.parameters())


def test_the_norm_and_a_block_equal_their_formulas() -> None:
    torch.manual_seed(2)
    x = torch.rand(1, 4, 5, 6)
    expected = torch.nn.functional.layer_norm(x.permute(0, 2, 3, 1), (4,), eps=1e-6)
    assert torch.allclose(ChannelNorm(4)(x), expected.permute(0, 3, 1, 2), atol=1e-5)
    assert torch.equal(NafBlock(4)(x), x)


def test_impossible_shapes_are_refused() -> None:
    with pytest.raises(ContractError, match="as many scales"):
        NafConfig(encoder_blocks=(1,))
    with pytest.raises(ContractError, match="must be >= 1"):
        NafConfig(middle_blocks=0)
    with pytest.raises(ContractError, match="in_channels must be 3 or 6"):
        NafConfig(in_channels=4)
