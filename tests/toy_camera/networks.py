"""The two networks of the toy camera, small and without a weight that needs a start."""

from typing import Any

import torch
from torch import Tensor, nn

from camkit.errors import ContractError


class Denoiser(nn.Module):
    """(b, 1, h, w) -> (b, 1, h, w): the input, and what is added to it at half the size."""

    def __init__(self, width: int = 16) -> None:
        super().__init__()
        self.stride_px, self.in_channels = 2, 1
        self.head = nn.Conv2d(1, width, 6, 2, 2, bias=False)
        self.body = nn.Conv2d(width, width, 3, 1, 1, bias=False)
        self.tail = nn.Conv2d(width, 4, 3, 1, 1, bias=False)
        nn.init.zeros_(self.tail.weight)

    def forward(self, x: Tensor) -> Tensor:
        """Take the noise away."""
        deep = nn.functional.leaky_relu(self.body(nn.functional.leaky_relu(self.head(x), 0.1)), 0.1)
        return x + nn.functional.pixel_shuffle(self.tail(deep), 2)


class Upscaler(nn.Module):
    """(b, 1, h, w) -> (b, 1, 2 h, 2 w): every sample four times, and what is added to it."""

    def __init__(self, width: int = 16) -> None:
        super().__init__()
        self.stride_px, self.in_channels = 2, 1
        self.head = nn.Conv2d(1, width, 6, 2, 2, bias=False)
        self.body = nn.Conv2d(width, width, 3, 1, 1, bias=False)
        self.tail = nn.Conv2d(width, 16, 3, 1, 1, bias=False)
        nn.init.zeros_(self.tail.weight)

    def forward(self, x: Tensor) -> Tensor:
        """Make the picture twice as large, and sharp."""
        deep = nn.functional.leaky_relu(self.body(nn.functional.leaky_relu(self.head(x), 0.1)), 0.1)
        large = nn.functional.pixel_shuffle(torch.cat([x] * 4, dim=1), 2)
        return large + nn.functional.pixel_shuffle(self.tail(deep), 4)


def build_toy_network(name: str, **config: Any) -> nn.Module:
    """Build a network by its name.

    Raises:
        ContractError: If there is none of that name.
    """
    builders = {"denoiser": Denoiser, "upscaler": Upscaler}
    if name not in builders:
        raise ContractError(f"network must be one of {', '.join(builders)}; got {name!r}")
    return builders[name](**config)
