"""Published networks, built from the keys of their state dicts.

DnCNN (Zhang 2017)    convolutions, batch norms and ReLUs in a row
NAFNet (Chen 2022)    U-Net of gated blocks with pooled channel attention
"""

import re
from collections.abc import Mapping
from typing import Any, Final

from torch import Tensor, nn

State = Mapping[str, Tensor]
_ROW: Final = re.compile(r"(?:[a-z_]+\.)?(\d+)\.([a-z_]+)")
_PARTS: Final = ("intro.weight", "ending.weight", "middle_blks.0.conv1.weight")


def published_network(state: State) -> tuple[str, nn.Module, dict[str, Tensor]] | None:
    """Return name, network and weights of a published network; None for any other."""
    if all(part in state for part in _PARTS):
        return "NAFNet", _nafnet(state), dict(state)
    row = _row(state)
    if row is not None:
        return "DnCNN", *row
    return None


def _row(state: State) -> tuple[nn.Module, dict[str, Tensor]] | None:
    """Return convolutions in a row with ReLUs in the gaps; None if it is something else."""
    places: dict[int, dict[str, Tensor]] = {}
    for key, value in state.items():
        match = _ROW.fullmatch(key)
        if match is None:
            return None
        places.setdefault(int(match[1]), {})[match[2]] = value
    layers: list[nn.Module] = []
    renamed: dict[str, Tensor] = {}
    for place in sorted(places):
        entries = places[place]
        weight = entries.get("weight")
        while len(layers) < place:
            layers.append(nn.ReLU())
        if weight is None or weight.ndim not in (1, 4):
            return None
        layers.append(_layer(weight, entries))
        renamed |= {f"{place}.{name}": value for name, value in entries.items()}
    convolutions = [layer for layer in layers if isinstance(layer, nn.Conv2d)]
    if len(convolutions) < 3 or not isinstance(layers[0], nn.Conv2d):
        return None
    return nn.Sequential(*layers), renamed


def _layer(weight: Tensor, entries: Mapping[str, Tensor]) -> nn.Module:
    if weight.ndim == 1:
        return nn.BatchNorm2d(weight.numel())
    outputs, inputs, side, _ = weight.shape
    return nn.Conv2d(inputs, outputs, side, padding=side // 2, bias="bias" in entries)


class _Gate(nn.Module):
    """Half of the channels times the other half."""

    def forward(self, x: Tensor) -> Tensor:
        """Return the product."""
        first, second = x.chunk(2, dim=1)
        return first * second


class _ChannelNorm(nn.Module):
    """A norm over the channels of a pixel."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(Tensor(channels))
        self.bias = nn.Parameter(Tensor(channels))

    def forward(self, x: Tensor) -> Tensor:
        """Return (x - mean) / sqrt(variance + 1e-6), affine."""
        rest = x - x.mean(1, keepdim=True)
        even = rest / ((rest * rest).mean(1, keepdim=True) + 1e-6).sqrt()
        return self.weight.view(1, -1, 1, 1) * even + self.bias.view(1, -1, 1, 1)


class _Block(nn.Module):
    """A block of NAFNet."""

    def __init__(self, c: int) -> None:
        super().__init__()
        self.conv1, self.conv3 = nn.Conv2d(c, 2 * c, 1), nn.Conv2d(c, c, 1)
        self.conv2 = nn.Conv2d(2 * c, 2 * c, 3, padding=1, groups=2 * c)
        self.sca = nn.Sequential(nn.AdaptiveAvgPool2d(1), nn.Conv2d(c, c, 1))
        self.conv4, self.conv5 = nn.Conv2d(c, 2 * c, 1), nn.Conv2d(c, c, 1)
        self.norm1, self.norm2 = _ChannelNorm(c), _ChannelNorm(c)
        self.beta, self.gamma = (nn.Parameter(Tensor(1, c, 1, 1)) for _ in range(2))
        self.gate = _Gate()

    def forward(self, picture: Tensor) -> Tensor:
        """Return the restored features."""
        x = self.gate(self.conv2(self.conv1(self.norm1(picture))))
        y = picture + self.conv3(x * self.sca(x)) * self.beta
        result: Tensor = y + self.conv5(self.gate(self.conv4(self.norm2(y)))) * self.gamma
        return result


class _NafNet(nn.Module):
    """NAFNet for sides that are multiples of its stride."""

    def __init__(self, channels: int, width: int, counts: dict[str, Any]) -> None:
        super().__init__()
        self.stride_px = 2 ** len(counts["encoders"])
        self.in_channels = channels
        self.intro = nn.Conv2d(channels, width, 3, padding=1)
        self.ending = nn.Conv2d(width, channels, 3, padding=1)
        self.encoders, self.decoders = nn.ModuleList(), nn.ModuleList()
        self.ups, self.downs = nn.ModuleList(), nn.ModuleList()
        c = width
        for count in counts["encoders"]:
            self.encoders.append(nn.Sequential(*[_Block(c) for _ in range(count)]))
            self.downs.append(nn.Conv2d(c, 2 * c, 2, 2))
            c *= 2
        self.middle_blks = nn.Sequential(*[_Block(c) for _ in range(counts["middle"])])
        for count in counts["decoders"]:
            enlarging = nn.Conv2d(c, 2 * c, 1, bias=False)
            self.ups.append(nn.Sequential(enlarging, nn.PixelShuffle(2)))
            c //= 2
            self.decoders.append(nn.Sequential(*[_Block(c) for _ in range(count)]))

    def forward(self, picture: Tensor) -> Tensor:
        """Return the restored picture."""
        x, skips = self.intro(picture), []
        for encoder, shrinking in zip(self.encoders, self.downs, strict=True):
            x = encoder(x)
            skips.append(x)
            x = shrinking(x)
        x = self.middle_blks(x)
        for decoder, enlarging, skip in zip(self.decoders, self.ups, skips[::-1], strict=True):
            x = decoder(enlarging(x) + skip)
        result: Tensor = self.ending(x) + picture
        return result


def _nafnet(state: State) -> nn.Module:
    width, channels = state["intro.weight"].shape[:2]
    counts = {name: _counts(state, name) for name in ("encoders", "decoders")}
    middle = 1 + max(int(k.split(".")[1]) for k in state if k.startswith("middle_blks."))
    return _NafNet(int(channels), int(width), {**counts, "middle": middle})


def _counts(state: State, name: str) -> list[int]:
    """Return the blocks of every level."""
    places = {tuple(map(int, k.split(".")[1:3])) for k in state if k.startswith(f"{name}.")}
    levels = sorted({level for level, _ in places})
    return [1 + max(block for at, block in places if at == level) for level in levels]
