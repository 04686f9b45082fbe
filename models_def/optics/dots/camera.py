"""The camera that a plate of dots is made for: laser, lens, lattice, cells."""

import math
from dataclasses import dataclass
from typing import Final

import torch

from camkit.calibration.dots import ACTIVE_UM, SPACING_UM
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.etching import Etching
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.units import UM_PER_MM

ORDERS: Final = 11
"""Dots along a side."""
LEAST_CELLS: Final = 2 * ORDERS
"""Of a unit: fewer bend the light of the dots, and reach no farther than these."""
MOST_CELLS: Final = 352
SILICA: Final = "fused-silica-Malitson1965"


@dataclass(frozen=True, slots=True, kw_only=True)
class DotCamera:
    """The camera of a plate of dots; the defaults are the prototype of the thesis.

    Attributes:
        wavelength_um: Of the laser.
        focal_length_mm: Of the lens, in whose front focal plane the plate lies.
        spacing_um: Of the dots: the sub-pixels of the array.
        active_um: Diameter of the round area of a pixel that sees.
        cells: Along a side of one unit.
        tiles: Units along a side of the plate.
        glass: Strict name of the plate's material.
    """

    wavelength_um: float = 0.655
    focal_length_mm: float = 50.0
    spacing_um: float = SPACING_UM
    active_um: float = ACTIVE_UM
    cells: int = 88
    tiles: int = 16
    glass: str = SILICA

    def __post_init__(self) -> None:
        """Refuse what is no such camera.

        Raises:
            ContractError: If so, or the glass is not known.
        """
        lengths = (self.wavelength_um, self.focal_length_mm, self.spacing_um, self.active_um)
        if not all(0 < length < math.inf for length in lengths):
            raise ContractError(f"lengths must be > 0; got {lengths}")
        if self.active_um > self.spacing_um:
            raise ContractError(
                f"an active area of {self.active_um:g} um is wider than the dots are apart, "
                f"{self.spacing_um:g} um"
            )
        if not LEAST_CELLS <= self.cells <= MOST_CELLS:
            raise ContractError(
                f"a unit has {LEAST_CELLS} to {MOST_CELLS} cells along a side; got {self.cells}"
            )
        if self.tiles < 1:
            raise ContractError(f"tiles must be >= 1; got {self.tiles}")
        find_glass(self.glass)

    @property
    def unit_mm(self) -> float:
        """Return the side of one unit.

        References: Sun 2021, section 4.3.3, l_u = lambda f / l_p.
        """
        return self.wavelength_um * self.focal_length_mm / self.spacing_um

    @property
    def cell_um(self) -> float:
        """Return the side of a cell."""
        return UM_PER_MM * self.unit_mm / self.cells

    @property
    def index(self) -> float:
        """Return the index of the plate in air, at the wavelength of the laser."""
        wave = torch.tensor([self.wavelength_um], dtype=torch.float64)
        return float(refractive_index(find_glass(self.glass), wave))

    def etching(self, levels: int) -> Etching:
        """Return the etching of a plate of so many levels: over one cycle of phase.

        Raises:
            ContractError: If levels are not 2, 4, 8, ...

        References: Sun 2021, eq. (4.5).
        """
        cycle_um = self.wavelength_um / (self.index - 1)
        return Etching(range_um=cycle_um, levels=levels, wraps=True)
