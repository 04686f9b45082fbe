"""The interface of all optics for freezing: kernels over field, depth and wavelength, geometry.

    Optics = LensOptics        a lens, traced where it is asked for    (lens_optics.py)
           | PlateOptics       a plate, computed where it is asked for (diffraction/plate_optics.py)
           | MeasuredOptics    kernels known at places of their own    (measured.py)

Positions are in millimetres on the sensor from the optical axis, +x to the right, +y down the rows.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from camkit.models_def.optics.psf import TracedPsf
from camkit.psf import Symmetry, grid_heights_mm
from camkit.radial import RadialDistortion

FloatGrid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldLayout:
    """The positions over the field of the kernels; see `camkit.psf.FrozenPsf`.

    Attributes:
        symmetry: How the kernels of other places follow.
        x_mm: (field,) positions; 0 for radial optics, whose places lie along +y.
        y_mm: (field,) positions.
        grid_x_mm: (column,) positions of a grid.
        grid_y_mm: (row,) positions of a grid.
    """

    symmetry: Symmetry
    x_mm: FloatGrid
    y_mm: FloatGrid
    grid_x_mm: FloatGrid | None = None
    grid_y_mm: FloatGrid | None = None

    @property
    def count(self) -> int:
        """Number of places."""
        return int(self.y_mm.size)

    @property
    def heights_mm(self) -> FloatGrid:
        """Distances (field,) from the axis."""
        if self.grid_x_mm is not None and self.grid_y_mm is not None:
            return grid_heights_mm(self.grid_x_mm, self.grid_y_mm)
        return self.y_mm


def radial_layout(heights_mm: FloatGrid) -> FieldLayout:
    """Return places along +y, increasing from 0, for optics of revolution."""
    return FieldLayout(symmetry="radial", x_mm=np.zeros_like(heights_mm), y_mm=heights_mm)


def uniform_layout() -> FieldLayout:
    """Return the one place of optics that are the same everywhere."""
    return FieldLayout(symmetry="uniform", x_mm=np.zeros(1), y_mm=np.zeros(1))


def grid_layout(x_mm: FloatGrid, y_mm: FloatGrid) -> FieldLayout:
    """Return the places of a grid of (column,) and (row,) positions, row by row."""
    y, x = (axis.ravel() for axis in np.meshgrid(y_mm, x_mm, indexing="ij"))
    return FieldLayout(symmetry="grid", x_mm=x, y_mm=y, grid_x_mm=x_mm, grid_y_mm=y_mm)


class Optics(Protocol):
    """Anything in front of a sensor whose PSF can be frozen."""

    @property
    def name(self) -> str:
        """Name, for people."""
        ...

    @property
    def facts(self) -> Mapping[str, float | str]:
        """Further facts for the report of freezing, units in the names."""
        ...

    @property
    def depths_mm(self) -> tuple[float, ...]:
        """Object distances at which it is frozen unless others are asked for, increasing."""
        ...

    @property
    def focus_mm(self) -> float:
        """Object distance that it is focused on; inf is allowed."""
        ...

    @property
    def reference_wavelength_um(self) -> float:
        """The wavelength to take where there is one alone."""
        ...

    @property
    def wavelengths_um(self) -> FloatGrid | None:
        """The wavelengths (n,), increasing, at which alone it is known; None if at any."""
        ...

    def layout(self, corner_mm: float, fields: int) -> FieldLayout:
        """Return the places to freeze at.

        Args:
            corner_mm: Distance of the sensor's corner from the axis.
            fields: How many samples from the axis to the corner; optics that are known at places
                of their own give those, whatever is asked for.
        """
        ...

    def kernels(
        self,
        fields: FieldLayout,
        wavelengths_um: FloatGrid,
        *,
        depth_mm: float,
        side_px: int,
        pitch_um: float,
    ) -> TracedPsf:
        """Return the kernels of places, as they fall on the sensor, in a window of odd side.

        Raises:
            ContractError: If it is not known there.
        """
        ...

    def distortion(self, radius_mm: float, channels: int) -> RadialDistortion:
        """Return the radial distortion of every channel, up to a distance from the axis."""
        ...

    def illumination(self, fields: FieldLayout) -> FloatGrid:
        """Return the relative illumination (field,), 1 on the axis."""
        ...

    def copies(self, count: int, seed: int) -> "tuple[Optics, ...]":
        """Return itself and `count` - 1 copies of it as they would be fabricated.

        Itself alone where nothing is known of its fabrication.
        """
        ...
