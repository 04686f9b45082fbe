"""A network that acts near lights alone; elsewhere its last three planes come out as they are.

    capture, lit --+-- network ------------------------- (-) -- (x) -- (+) -- output
                   |-- lit ------------------------------'------ | -----'
                   '-- raised? -- max, /8 -- wider -- softer -- x8'

`lit` is brighter than the capture where a light was put in, and nowhere else by more than what an
evenly lit plane gains when streaks are taken away. Around such pixels the network counts fully,
farther off less and less, and from `REACH_PX` on not at all: there the output is `lit` bit for bit,
so windows without lights need not be computed.
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
CELL_PX: Final = 8
WIDE_CELLS: Final = 4
SOFT_CELLS: Final = 2
REACH_PX: Final = CELL_PX * (WIDE_CELLS + SOFT_CELLS + 2)
"""From a light; the last two cells are its own and that of the interpolation."""


class NearLights(nn.Module):
    """Lets a network act near lights.

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
        return lit + nearness(planes) * change


def nearness(planes: Tensor) -> Tensor:
    """Give (b, 1, h, w), 1 near lights and 0 from `REACH_PX` on; planes as `NearLights` has."""
    raised = planes[:, COLOURS:] - RATIO * planes[:, :COLOURS] - FLOOR
    there = (raised / FLOOR).clamp(0, 1).amax(dim=1, keepdim=True)
    cells = nn.functional.max_pool2d(there, CELL_PX)
    wide = nn.functional.max_pool2d(cells, 2 * WIDE_CELLS + 1, 1, WIDE_CELLS)
    soft = nn.functional.avg_pool2d(wide, 2 * SOFT_CELLS + 1, 1, SOFT_CELLS)
    return nn.functional.interpolate(
        torch.as_tensor(soft), scale_factor=CELL_PX, mode="bilinear", align_corners=False
    )
