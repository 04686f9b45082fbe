"""A network that acts on lights alone; elsewhere its last three planes come out as they are.

    capture, lit --+-- network ------------------- (-) -- (x) -- (+) -- at least -- output
                   |-- lit ------------------------'------ | -----'        |
                   |-- raised? -- one pixel wider ---------'               |
                   '-- the darker of both, less beside lights -------------'

`lit` is brighter than the capture where a light was put in, and nowhere else by more than what an
evenly lit plane gains when streaks are taken away. The network acts on such pixels and on those
beside them. A light is at least as bright as the capture says, since it clipped there: no ring of
dark pixels about a lamp, though it would cost little beside what the lamp does. What did not clip
was seen, and physics has taken the streaks from it: a network that
is fitted to lights of hundreds of times white only makes it worse.
"""

from typing import Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.networks.lean_unet import LeanUnet

COLOURS: Final = 3
RATIO: Final = 1.1
"""Of stabilised values: 1.21 of the light; a core of 83 % of the light would raise by as much."""
FLOOR: Final = 0.05
"""Stabilised; several standard deviations of the noise."""
BESIDE_PX: Final = 1
LEAST: Final = 0.9
"""Stabilised, of what was seen beside lights: four fifths of the light. A network spends little on
faint pixels beside what a lamp costs it, and left to itself it colours the rims of lamps."""
REACH_PX: Final = 4
"""From a clipped sample: a demosaic and the pixels of a light reach two pixels, this one more."""


class NearLights(nn.Module):
    """Lets a network act on lights.

    Attributes:
        inner: From (b, 6, h, w) to (b, 3, h, w), stabilised.
    """

    def __init__(self, inner: LeanUnet) -> None:
        super().__init__()
        if inner.in_channels != 2 * COLOURS:
            raise ContractError(
                f"a network near lights takes capture and lit, {2 * COLOURS} channels; "
                f"got {inner.in_channels}"
            )
        self.inner = inner
        self.in_channels = inner.in_channels
        self.stride_px = inner.stride_px

    def forward(self, planes: Tensor) -> Tensor:
        """Restore the last three planes near lights.

        Args:
            planes: (b, 6, h, w) float32, stabilised: capture and lit; h, w multiples of
                `stride_px`.

        Returns:
            (b, 3, h, w) float32, stabilised.
        """
        lit = planes[:, COLOURS:]
        change: Tensor = self.inner(planes) - lit
        return torch.maximum(lit + nearness(planes) * change, least(planes))


def nearness(planes: Tensor) -> Tensor:
    """Return (b, 1, h, w), 1 on lights and beside them, 0 elsewhere; planes as `NearLights` has."""
    there = raised(planes).amax(dim=1, keepdim=True)
    return nn.functional.max_pool2d(there, 2 * BESIDE_PX + 1, 1, BESIDE_PX)


def least(planes: Tensor) -> Tensor:
    """Return (b, 3, h, w): what the output is at least; never more than `lit`."""
    darker = torch.minimum(planes[:, :COLOURS], planes[:, COLOURS:])
    return darker * (LEAST + (1 - LEAST) * raised(planes))


def raised(planes: Tensor) -> Tensor:
    """Return (b, 3, h, w): 1 where a light was put into a colour, 0 elsewhere."""
    more = planes[:, COLOURS:] - RATIO * planes[:, :COLOURS] - FLOOR
    return (more / FLOOR).clamp(0, 1)
