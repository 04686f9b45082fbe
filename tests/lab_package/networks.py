"""A plain network: convolutions that add to the planes they are given."""

from itertools import pairwise

from torch import Tensor, nn


class PlainNetwork(nn.Module):
    """Residual convolutions.

    Attributes:
        in_channels: Planes that it takes; the last three are corrected.
        stride_px: Sides of its input are multiples of this.
    """

    stride_px = 1

    def __init__(self, width: int = 8, depth: int = 2, in_channels: int = 6) -> None:
        super().__init__()
        self.in_channels = in_channels
        widths = [in_channels, *[width] * depth]
        layers: list[nn.Module] = []
        for before, after in pairwise(widths):
            layers += [nn.Conv2d(before, after, 3, padding=1), nn.ReLU()]
        self.body = nn.Sequential(*layers, nn.Conv2d(widths[-1], 3, 3, padding=1))

    def forward(self, planes: Tensor) -> Tensor:
        """Return the last three planes, corrected."""
        corrected: Tensor = planes[:, -3:] + self.body(planes)
        return corrected
