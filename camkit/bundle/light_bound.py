"""The bound on the light that a network may move (format 2.8), and what it is computed on.

    added light, per 4x4 cell -> weighted mean -> smoothed over 3x3 cells -> beyond the bound: taken
    back, interpolated over the pixels

A network behind a bank adds detail to a picture whose local mean is right already. What its own
local mean adds beyond what noise and an error of the kernels explain is taken back; beside clipped
samples nothing is added at all. `camkit/runtime/network/light.py` and
`camkit/models_def/networks/light.py` compute it.
"""

from typing import Annotated, Final

from pydantic import Field

from camkit.bundle.entry import Entry, NonNegative

CELL_PX: Final = 4
"""Side of a cell. Cells lie on the lattice of the picture, which windows keep to."""
SMOOTHING: Final = (0.25, 0.5, 0.25)
"""Over neighbouring cells, along rows and along columns."""
CELLS_AVERAGED: Final = 64 / 9
"""Cells of equal weight whose mean has the noise of a smoothed cell: 1 / (sum of squares)^2."""
BOUND_REACH_PX: Final = 9
"""From a pixel to the farthest one that its bound is computed from: its own cell, the next one by
interpolation, one more by smoothing; the second row of a cell lies 9 from the first of that."""
NEAR_PX: Final = (3, 5)
"""Distances from a clipped sample, along rows and columns: up to the first nothing that a network
adds is kept, up to the second half of it."""
MASK_REACH_PX: Final = BOUND_REACH_PX + NEAR_PX[1]
"""From a pixel to the farthest clipped sample that it depends on."""


class LightBound(Entry):
    """How far the local mean of a network's output may leave that of its last plane.

    The standard deviation of a stabilised value is what noise, an error of the kernels and one of
    the light explain:

        sigma^2 = (0.5 / scale)^2 / pixels averaged + psf_error^2 * (variance of cell means)
                  + (light_error / 2 * mean)^2

    Attributes:
        deviations: So many standard deviations; 0 admits detail alone.
        psf_error: Relative error of the kernels.
        light_error: Relative error of the light.
    """

    deviations: Annotated[float, Field(ge=0, le=100)] = 0.0
    psf_error: NonNegative = 0.1
    light_error: NonNegative = 0.0


USUAL_BOUND: Final = LightBound(deviations=3.0, psf_error=0.1, light_error=0.01)
"""What a network is held against that states no bound of its own."""
