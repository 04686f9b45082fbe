"""Sharp patches blurred by kernels and recorded, with gradients to the kernels."""

from dataclasses import dataclass

from torch import Tensor

from camkit.cfa import CfaPattern
from camkit.errors import ContractError
from camkit.models_def.sensors.demosaic import demosaic, mosaic
from camkit.models_def.sensors.forward import blur


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorder:
    """The pixels of a design: light plus white Gaussian noise, as in eq. (6.9).

    Attributes:
        noise: Standard deviation, 1.0 = white level.
        cfa: Colour filters of the pixels, demosaicked linearly; None for three colours in each
            pixel. Without it a design believes in detail that a mosaic cannot record.
    """

    noise: float = 0.01
    cfa: CfaPattern | None = None

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
        (b, 3, h, w) linear, clipped to 0..1 with gradients passed on, then demosaicked.

    References: Sun 2021, eq. (6.9).
    """
    light = blur(sharp, kernels.to(sharp.dtype)) + recorder.noise * normal
    recorded = light + (light.clamp(0, 1) - light).detach()
    if recorder.cfa is None:
        return recorded
    return demosaic(mosaic(recorded, recorder.cfa), recorder.cfa)
