"""The generator of the thesis's fine-tuning: the trimmed U-Net with its deep scales put back.

    /1   encode ------------------------------------------- merge -- output
    /2     encode ------------------------------------- merge          the trimmed U-Net
    /4       bottleneck --+------------------- (+) -- up
    /8                    '-- encode -- ... merge  |
    ...                         ...                |  join             the deep scales
    /64                        bottleneck          '

Seven scales, six max poolings and six upsamplings (Sun 2021, section 6.2.2 and figure 6.3). The
deep scales add to the features at a quarter of the size through a convolution that starts at zero,
so a generator that was started from a trimmed U-Net first computes what that one did. The text
gives no widths; doubling up to 512 follows the authors' public code of the thin-plate camera (Peng,
Sun et al. 2019).

An upsampling of the deep scales is a 1x1 convolution with a pixel-shuffle: the same function as a
transposed 2x2 convolution of stride 2, but with equal bits wherever its window lies.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.networks.lean_unet import Upsampling
from camkit.models_def.networks.trimmed_unet import TrimmedConfig, TrimmedUnet, double_conv

SCALES = 7
OUTER_SCALES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class FullConfig:
    """Shape of a `FullUnet`.

    Attributes:
        widths: Channels at the seven scales /1 ... /64; the first three must be those of the
            trimmed U-Net it is to be started from.
        in_channels: 6 (capture and Wiener planes) or 3 (one picture).
        residual: Whether the output is added to the last three input planes.
    """

    widths: tuple[int, ...] = (32, 64, 128, 256, 512, 512, 512)
    in_channels: int = 6
    residual: bool = True

    def __post_init__(self) -> None:
        if len(self.widths) != SCALES or min(self.widths) <= 0:
            raise ContractError(f"widths must be {SCALES} positive integers; got {self.widths}")

    def outer(self) -> TrimmedConfig:
        """Return the shape of the outer three scales."""
        a, b, c = self.widths[:OUTER_SCALES]
        return TrimmedConfig(widths=(a, b, c), in_channels=self.in_channels, residual=self.residual)


class DeepScales(nn.Module):
    """The scales below a quarter of the size; a new one gives zeros."""

    def __init__(self, widths: tuple[int, ...]) -> None:
        super().__init__()
        pairs = list(pairwise(widths))
        self.encoders = nn.ModuleList(double_conv(a, b) for a, b in pairs)
        self.ups = nn.ModuleList(Upsampling(b, a, bias=True) for a, b in pairs)
        self.merges = nn.ModuleList(double_conv(2 * a, a) for a, _ in pairs)
        self.join = nn.Conv2d(widths[0], widths[0], 3, padding=1)
        nn.init.zeros_(self.join.weight)
        nn.init.zeros_(torch.as_tensor(self.join.bias))

    def forward(self, x: Tensor) -> Tensor:
        """Return (b, widths[0], h, w) from the same; h, w multiples of 2^(len(widths) - 1)."""
        skips = []
        for encoder in self.encoders:
            skips.append(x)
            x = encoder(nn.functional.max_pool2d(x, 2))
        for i in reversed(range(len(skips))):
            x = self.merges[i](torch.cat((self.ups[i](x), skips[i]), dim=1))
        joined: Tensor = self.join(x)
        return joined


class FullUnet(nn.Module):
    """The generator. References: Sun 2021, section 6.2.2 and figure 6.3."""

    def __init__(self, config: FullConfig | None = None) -> None:
        super().__init__()
        self.config = config or FullConfig()
        self.in_channels = self.config.in_channels
        self.stride_px = 2 ** (SCALES - 1)
        self.outer = TrimmedUnet(self.config.outer())
        self.deep = DeepScales(self.config.widths[OUTER_SCALES - 1 :])

    def forward(self, planes: Tensor) -> Tensor:
        """Restore the last three planes.

        Args:
            planes: (b, in_channels, h, w) float32, stabilised; h, w multiples of 64.

        Returns:
            (b, 3, h, w) float32, stabilised.
        """
        fine, half, quarter = self.outer.encode(planes)
        return self.outer.decode(planes, fine, half, quarter + self.deep(quarter))


def start_from_trimmed(network: FullUnet, trimmed: Mapping[str, Tensor]) -> tuple[str, ...]:
    """Copy the weights of a trimmed U-Net into the outer three scales, in place.

    Args:
        network: The generator.
        trimmed: State of a `TrimmedUnet` of the same first three widths.

    Returns:
        The names of the generator's tensors that were copied; all others keep their start.

    Raises:
        ContractError: If the names or shapes are not those of the outer scales.
    References: Sun 2021, section 6.2.2 (the corresponding layers are initialised so).
    """
    try:
        network.outer.load_state_dict(dict(trimmed))
    except RuntimeError as error:
        raise ContractError(
            f"the weights are not those of a trimmed U-Net of widths "
            f"{network.config.widths[:OUTER_SCALES]} and {network.in_channels} planes: {error}"
        ) from error
    return tuple(f"outer.{name}" for name in trimmed)
