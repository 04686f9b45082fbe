"""The fusion network: the picture without streaks and the lights, put together.

    I_U -- 3x3 (64) -- 3x3 (64) --.
                                concat -- 3x3 (32) -- 3x3 (3)
    I_S -- 3x3 (64) -- 3x3 (64) --'

A leaky ReLU follows every convolution, the last one too, as table 5.3 has it. The caption of that
table explains nm(x), which no row of it uses: there is no norm.

References: Sun 2021, section 5.4, eq. (5.5), table 5.3.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.highlight import MOST_LIGHT
from camkit.models_def.kinds.hdr.thesis.layers import active, clip, conv


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionConfig:
    """Shape of a `FusionNetwork`.

    Attributes:
        width: Channels of each branch.
        merged: Channels behind the concatenation.
    """

    width: int = 64
    merged: int = 32

    def __post_init__(self) -> None:
        if min(self.width, self.merged) < 1:
            raise ContractError(f"widths must be positive; got {self.width}, {self.merged}")


class FusionNetwork(nn.Module):
    """The fusion network; plain convolutions, exact under tiling."""

    def __init__(self, config: FusionConfig | None = None) -> None:
        super().__init__()
        self.config = config or FusionConfig()
        self.stride_px = 1
        width, merged = self.config.width, self.config.merged
        self.clean = nn.Sequential(active(conv(3, width, 3)), active(conv(width, width, 3)))
        self.lights = nn.Sequential(active(conv(3, width, 3)), active(conv(width, width, 3)))
        self.merge = nn.Sequential(active(conv(2 * width, merged, 3)), active(conv(merged, 3, 3)))

    def forward(self, clean: Tensor, lights: Tensor) -> Tensor:
        """Return (b, 3, h, w), 0..2^8.

        Args:
            clean: (b, 3, h, w) without streaks, 0..1.
            lights: (b, 3, h, w) 0 where the capture is not saturated, else 1..2^8.
        """
        both = torch.cat([self.clean(clean), self.lights(lights)], dim=1)
        return clip(self.merge(both), 0, MOST_LIGHT)
