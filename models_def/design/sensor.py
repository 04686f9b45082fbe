"""Sharp patches blurred by kernels and recorded, with gradients to the kernels."""

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.sensors.forward import blur

_LINEAR_BELOW: Final = 0.0031308


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorder:
    """What the pixels do in a design: light plus white Gaussian noise, as eq. (6.9) has it.

    Attributes:
        noise: Standard deviation, 1.0 = white level.
    """

    noise: float = 0.01

    def __post_init__(self) -> None:
        if not self.noise >= 0:
            raise ContractError(f"noise must be >= 0; got {self.noise}")


def capture(sharp: Tensor, kernels: Tensor, recorder: Recorder, normal: Tensor) -> Tensor:
    """Blur and record patches.

    Args:
        sharp: (b, 3, h + k - 1, w + k - 1) linear.
        kernels: (b, 3, k, k).
        recorder: What the pixels do.
        normal: (b, 3, h, w) standard normal numbers.

    Returns:
        (b, 3, h, w) linear, clipped to 0..1 with gradients passed on.

    References: Sun 2021, eq. (6.9).
    """
    light = blur(sharp, kernels.to(sharp.dtype)) + recorder.noise * normal
    return light + (light.clamp(0, 1) - light).detach()


def encode(linear: Tensor) -> Tensor:
    """Give the sRGB tone of linear values; negative ones become black, as on a display."""
    light = linear.clamp_min(0)
    high = 1.055 * light.clamp_min(_LINEAR_BELOW) ** (1 / 2.4) - 0.055
    return torch.where(light <= _LINEAR_BELOW, 12.92 * light, high)
