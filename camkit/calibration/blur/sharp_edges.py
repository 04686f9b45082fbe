"""Edges that are as sharp as the lens: no edge of a scene is sharper, most are softer.

The sharpest share of each direction and place counts. To be among them by noise alone would make a
lens look too sharp: one half of an edge decides, and the samples of the other half are used.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.blur.blob_basis import FloatGrid
from camkit.calibration.blur.photo_edges import PhotoEdge

SHARPEST: Final = 0.3
"""Share of the edges of a direction and place that count."""
LEAST_KEPT: Final = 3
DIRECTIONS: Final = ("radial", "oblique", "tangential")
"""The blur that an edge shows: away from the axis, between, and around it."""
STEEP: Final = 0.87
"""Component of a normal from which on an edge shows the blur of one direction."""


def direction_of(edge: PhotoEdge) -> int:
    """Return the number of the direction in which an edge shows the blur, see `DIRECTIONS`."""
    if abs(edge.outward) > STEEP:
        return 0
    return 2 if edge.sideways > STEEP else 1


def sharp_halves(
    edges: Sequence[PhotoEdge], factors: FloatGrid, shares: FloatGrid
) -> NDArray[np.bool_]:
    """Return (edge, 2): the halves of edges whose samples count.

    Args:
        edges: All of them.
        factors: (edge, 2) widths of their halves, relative to what is predicted.
        shares: (edge, node) of each place of the field in an edge.
    """
    direction = np.array([direction_of(edge) for edge in edges])
    node = shares.argmax(axis=1)
    is_sharp = np.zeros(factors.shape, dtype=bool)
    for n in range(shares.shape[1]):
        for way in range(len(DIRECTIONS)):
            mine = np.flatnonzero((direction == way) & (node == n))
            if not mine.size:
                continue
            count = min(mine.size, max(LEAST_KEPT, round(SHARPEST * mine.size)))
            for half in (0, 1):
                widths = np.nan_to_num(factors[mine, half], nan=np.inf)
                sharpest = mine[np.argsort(widths, kind="stable")[:count]]
                is_sharp[sharpest, 1 - half] = True
    return is_sharp
