"""The sRGB tone in torch, for losses on what a display shows.

References: IEC 61966-2-1.
"""

from typing import Final

import torch
from torch import Tensor

_LINEAR_BELOW: Final = 0.0031308


def encode_srgb(linear: Tensor) -> Tensor:
    """Return the sRGB tone of linear values; negative ones become black, as on a display."""
    light = linear.clamp(min=0)
    # the power has an infinite slope at 0, which would turn the other branch's gradient into NaN
    high = 1.055 * light.clamp(min=_LINEAR_BELOW) ** (1 / 2.4) - 0.055
    return torch.where(light <= _LINEAR_BELOW, 12.92 * light, high)
