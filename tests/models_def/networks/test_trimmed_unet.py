"""The thesis's trimmed U-Net is what section 6.2.2 says."""

import pytest
import torch
from torch import nn

from camkit.errors import ContractError
from camkit.models_def.networks.trimmed_unet import TrimmedConfig, TrimmedUnet


def test_two_transposed_convolutions_and_a_prelu_after_every_3x3_but_the_last() -> None:
    modules = list(TrimmedUnet().modules())
    convs = [m for m in modules if isinstance(m, nn.Conv2d)]
    assert all(conv.kernel_size == (3, 3) for conv in convs)
    assert sum(isinstance(m, nn.ConvTranspose2d) for m in modules) == 2
    assert sum(isinstance(m, nn.PReLU) for m in modules) == len(convs) - 1 == 10


def test_bottleneck_is_two_flat_convolutions_at_a_quarter_of_the_size() -> None:
    network = TrimmedUnet()
    shapes: list[torch.Size] = []
    network.bottleneck.register_forward_hook(lambda _, i, o: shapes.extend((i[0].shape, o.shape)))
    network(torch.zeros(1, 6, 32, 24))
    assert shapes == [(1, 64, 8, 6), (1, 128, 8, 6)]


@pytest.mark.parametrize("channels", [3, 6])
def test_residual_output_is_added_to_the_last_three_planes(channels: int) -> None:
    torch.manual_seed(0)
    network = TrimmedUnet(TrimmedConfig(widths=(8, 16, 32), in_channels=channels))
    direct = TrimmedUnet(TrimmedConfig(widths=(8, 16, 32), in_channels=channels, residual=False))
    direct.load_state_dict(network.state_dict())
    planes = torch.rand(2, channels, 16, 20)
    assert torch.allclose(network(planes), direct(planes) + planes[:, -3:])


def test_a_pixel_reaches_24_pixels_and_no_further() -> None:
    network = TrimmedUnet(TrimmedConfig(widths=(4, 4, 4))).double()
    for parameter in network.parameters():
        nn.init.uniform_(parameter, 0.01, 0.1)
    reach = 0
    for phase in range(4):
        planes = torch.rand(1, 6, 64, 64, dtype=torch.float64, requires_grad=True)
        network(planes)[0, :, 32 + phase, 32 + phase].sum().backward()
        assert planes.grad is not None
        rows = planes.grad.abs().sum(dim=(0, 1, 3)).nonzero()[:, 0]
        reach = max(reach, 32 + phase - int(rows.min()), int(rows.max()) - 32 - phase)
    assert 20 <= reach <= 24


@pytest.mark.parametrize("changes", [{"widths": (32, 64)}, {"widths": (0, 1, 2)}])
def test_impossible_widths_are_refused(changes: dict[str, tuple[int, ...]]) -> None:
    with pytest.raises(ContractError, match="three positive integers"):
        TrimmedConfig(**changes)  # type: ignore[arg-type]


def test_other_channel_counts_are_refused() -> None:
    with pytest.raises(ContractError, match="in_channels must be 3 or 6"):
        TrimmedConfig(in_channels=1)
