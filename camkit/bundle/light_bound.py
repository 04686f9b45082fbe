"""The bound on the light that a network may move (format 2.8), and what it is computed on.

    added light, per 4x4 cell -> weighted mean -> smoothed over 3x3 cells -> beyond the bound: taken
    back, interpolated over the pixels

A network behind a bank adds detail to a picture whose local mean is right already. What its own
local mean adds beyond what noise and an error of the kernels explain is taken back; beside clipped
samples nothing is added at all, and what is nearly white is not darkened.
`camkit/runtime/network/light_bound.py` and `camkit/models_def/networks/light.py` compute it.
"""

from typing import Annotated, Final

from pydantic import Field

from camkit.bundle.entry import Entry

CELL_PX: Final = 4
"""Side of a cell. Cells lie on the lattice of the picture, which windows keep to."""
SMOOTHING: Final = (0.25, 0.5, 0.25)
"""Over neighbouring cells, along rows and along columns."""
CELLS_AVERAGED: Final = 64 / 9
"""Cells of equal weight whose mean has the noise of a smoothed cell: 1 / (sum of squares)^2."""
NOISE_OF_CELLS: Final = 4.0
"""So many times the noise of a cell counts as noise: a filter and a demosaic raise it."""
BOUND_REACH_PX: Final = 9
"""From a pixel to the farthest one that its bound is computed from: its own cell, the next one by
interpolation, one more by smoothing; the second row of a cell lies 9 from the first of that."""
NEAR_PX: Final = (3, 5)
"""Distances from a clipped sample, along rows and columns: up to the first nothing that a network
adds is kept, up to the second half of it."""
BRIGHT: Final = 0.8
"""Share of white that a pixel has in every colour where it is not darkened at all."""
BRIGHT_FROM: Final = 0.7
"""Of the stabilised value of `BRIGHT`: below it a pixel may become as dark as it will."""
BRIGHT_NOISE: Final = 8.0
"""Standard deviations of the noise by which such a pixel may become darker: grain is removed."""


class LightBound(Entry):
    """A limit on how far the local mean of a network's output leaves that of its last plane.

    In stabilised values, over smoothed cells of the last plane, m their mean and V their variance:

        limit^2 = (noise * n)^2 + (light / 2 * m)^2
                  + spread^2 * max(V - NOISE_OF_CELLS * n_cell^2, 0)

    with n_cell = 0.5 / (scale * side of a cell), the noise of a cell, and n that of a smoothed one.
    All zero admits detail alone.

    Attributes:
        noise: So many standard deviations of the noise.
        spread: So much of the contrast between cells that noise does not explain: what an error of
            the kernels may have got wrong.
        light: Relative error of the light.
        keeps_bright: Whether what is nearly white in every colour is not darkened. With q the least
            stabilised value over that of `BRIGHT`, among the colours of a pixel of the last plane,
            its output is at least clip((q - BRIGHT_FROM) / (1 - BRIGHT_FROM), 0, 1) times that
            plane, less `BRIGHT_NOISE` standard deviations of the noise.
    """

    noise: Annotated[float, Field(ge=0, le=1000)] = 0.0
    spread: Annotated[float, Field(ge=0, le=1000)] = 0.0
    light: Annotated[float, Field(ge=0, le=1000)] = 0.0
    keeps_bright: bool = False

    @property
    def admits_detail_alone(self) -> bool:
        """Return whether no light may be moved at all."""
        return self.noise == self.spread == self.light == 0


USUAL_BOUND: Final = LightBound(noise=3.0, spread=0.3, light=0.03, keeps_bright=True)
"""The bound of networks that state none of their own."""
