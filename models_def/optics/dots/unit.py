"""One unit of a plate of dots, as it is etched: its levels, heights, masks and light."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.etching import Etching, mask_layers
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.levels import LevelGrid
from camkit.models_def.optics.dots.orders import intensity, order_matrix, orders_of
from camkit.models_def.optics.dots.target import FloatGrid


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DotPlate:
    """One unit of a plate, as it is etched.

    Attributes:
        camera: What it is made for.
        level: (cells, cells) int64, 0 .. levels - 1; 0 is etched deepest.
        levels: How many there are.
    """

    camera: DotCamera
    level: LevelGrid
    levels: int

    def __post_init__(self) -> None:
        """Refuse levels that are none.

        Raises:
            ContractError: If so.
        """
        side = (self.camera.cells, self.camera.cells)
        if self.level.shape != side or self.level.min() < 0 or self.level.max() >= self.levels:
            raise ContractError(
                f"levels must be {side} from 0 to {self.levels - 1}; got {self.level.shape} from "
                f"{self.level.min()} to {self.level.max()}"
            )

    @property
    def etching(self) -> Etching:
        """Return its etching."""
        return self.camera.etching(self.levels)

    @property
    def height_um(self) -> FloatGrid:
        """Return the heights (cells, cells) above the deepest level."""
        return np.asarray(self.level * self.etching.step_um)

    @property
    def masks(self) -> NDArray[np.bool_]:
        """Return the masks (mask, cells, cells), that of one step first: True where glass stays."""
        return np.asarray(mask_layers(torch.from_numpy(self.level), self.levels).numpy())

    @property
    def light(self) -> FloatGrid:
        """Return the light (11, 11) of its dots, shares of all light."""
        return phase_light(np.asarray(self.level * (2 * np.pi / self.levels), dtype=np.float64))

    def etched_um(self, depth_errors: Sequence[float]) -> FloatGrid:
        """Return the heights where each mask etches too deep by a share, one a mask.

        Raises:
            ContractError: If there is not one error a mask.
        """
        relief = self.etching.etched(torch.from_numpy(self.height_um), depth_errors)
        return np.asarray(relief.numpy())


def phase_light(phase: FloatGrid) -> FloatGrid:
    """Return the light (11, 11) of the dots of phases (cells, cells), shares of all light."""
    return intensity(orders_of(np.exp(1j * phase), order_matrix(phase.shape[0])))
