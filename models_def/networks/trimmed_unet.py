"""The trimmed U-Net of the thesis, kept as a reference.

Three scales, two max poolings, two transposed convolutions, two flat convolutions at the bottleneck
and a PReLU after every convolution (Sun 2021, section 6.2.2). The text gives neither widths nor the
number of convolutions per scale; two 3x3 per scale and a residual output follow the authors' public
code of the thin-plate camera (Peng, Sun et al. 2019), and the widths are free.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class TrimmedConfig:
    """Shape of a `TrimmedUnet`.

    Attributes:
        widths: Channels at the three scales /1, /2, /4.
        in_channels: 6 (capture and Wiener planes) or 3 (one picture).
        residual: Whether the output is added to the last three input planes.
    """

    widths: tuple[int, int, int] = (32, 64, 128)
    in_channels: int = 6
    residual: bool = True

    def __post_init__(self) -> None:
        if len(self.widths) != 3 or min(self.widths) <= 0:
            raise ContractError(f"widths must be three positive integers; got {self.widths}")
        if self.in_channels not in (3, 6):
            raise ContractError(f"in_channels must be 3 or 6; got {self.in_channels}")


def double_conv(inputs: int, outputs: int) -> nn.Sequential:
    """Return two 3x3 convolutions, a PReLU behind each."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, padding=1),
        nn.PReLU(),
        nn.Conv2d(outputs, outputs, 3, padding=1),
        nn.PReLU(),
    )


class TrimmedUnet(nn.Module):
    """The trimmed U-Net. References: Sun 2021, section 6.2.2 and figure 6.3."""

    def __init__(self, config: TrimmedConfig | None = None) -> None:
        super().__init__()
        self.config = config or TrimmedConfig()
        self.in_channels = self.config.in_channels
        self.stride_px = 4
        a, b, c = self.config.widths
        self.encode_fine = double_conv(self.in_channels, a)
        self.encode_half = double_conv(a, b)
        self.bottleneck = double_conv(b, c)
        self.up_half = nn.ConvTranspose2d(c, b, 2, stride=2)
        self.merge_half = double_conv(2 * b, b)
        self.up_fine = nn.ConvTranspose2d(b, a, 2, stride=2)
        self.merge_fine = double_conv(2 * a, a)
        self.out = nn.Conv2d(a, 3, 3, padding=1)

    def forward(self, planes: Tensor) -> Tensor:
        """Restore the last three planes.

        Args:
            planes: (b, in_channels, h, w) float32, stabilised; h, w multiples of 4.

        Returns:
            (b, 3, h, w) float32, stabilised.
        """
        fine, half, quarter = self.encode(planes)
        return self.decode(planes, fine, half, quarter)

    def encode(self, planes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return the features (b, widths[i], h / 2^i, w / 2^i) of the three scales."""
        fine: Tensor = self.encode_fine(planes)
        half: Tensor = self.encode_half(nn.functional.max_pool2d(fine, 2))
        quarter: Tensor = self.bottleneck(nn.functional.max_pool2d(half, 2))
        return fine, half, quarter

    def decode(self, planes: Tensor, fine: Tensor, half: Tensor, quarter: Tensor) -> Tensor:
        """Return (b, 3, h, w) from the input and the features of `encode`."""
        x = self.merge_half(torch.cat((self.up_half(quarter), half), dim=1))
        x = self.merge_fine(torch.cat((self.up_fine(x), fine), dim=1))
        restored: Tensor = self.out(x)
        return planes[:, -3:] + restored if self.config.residual else restored
