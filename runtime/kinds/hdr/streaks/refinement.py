"""Lights in cells of half the pitch, sought again group by group, each near itself alone.

    lights of cells of 4 px -> groups of neighbours -> each in cells of 2 px, in its surroundings

What a light throws far away says how bright it is, and coarse cells see that; what it is like
within is said nearby. What other groups throw there is known from the coarser cells. So the work
grows with the lights, and a picture full of them is refined as one lamp is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.cells import Cells
from camkit.runtime.kinds.hdr.streaks.convolution import spreading
from camkit.runtime.kinds.hdr.streaks.descent import FAINTEST, FINE_STEPS, seek_lights
from camkit.runtime.kinds.hdr.streaks.kernels import StreakKernels
from camkit.runtime.kinds.hdr.streaks.regions import Window
from camkit.runtime.kinds.hdr.streaks.shapes import dome, repeated, upsampled, with_means

GROUP_REACH: Final = 8
"""Coarse cells: lights farther from each other than twice that are of different groups."""
NEAR: Final = 16
"""Coarse cells about a group that are looked at."""
_EIGHT: Final = np.ones((3, 3), np.int8)
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseLights:
    """Lights of one colour in a window, in cells of 4 px.

    Attributes:
        window: In these cells.
        light: (h, w) float32, 0 outside the clipped cells.
        blurred: (h, w) float32: what becomes of it, itself included.
        veil: (h, w) float32: what unclipped light has thrown there.
        rim_px: Of its cells of 2 px: how far from the rim of what clipped, 0 outside.
    """

    window: Window
    light: FloatArray
    blurred: FloatArray
    veil: FloatArray
    rim_px: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Clipped cells of 4 px that are near each other.

    Attributes:
        window: Those cells and what is looked at about them, within the window of all.
        cells: (h, w) of that window: which cells are of the group, with those about them.
    """

    window: Window
    cells: Mask


def groups_of(clipped: Mask) -> tuple[Group, ...]:
    """Group the clipped cells (h, w) of a window, of any colour; every cell is in one group."""
    near = scipy.ndimage.maximum_filter(clipped, size=2 * GROUP_REACH + 1, mode="constant")
    labels, _ = scipy.ndimage.label(near, structure=_EIGHT)
    groups = []
    places = scipy.ndimage.find_objects(np.where(clipped, labels, 0))
    for number, (rows, columns) in enumerate(places, 1):
        window = Window(
            top=max(rows.start - NEAR, 0),
            bottom=min(rows.stop + NEAR, clipped.shape[0]),
            left=max(columns.start - NEAR, 0),
            right=min(columns.stop + NEAR, clipped.shape[1]),
        )
        groups.append(Group(window=window, cells=labels[window.at] == number))
    return tuple(groups)


def refined(
    colour: int, lights: CoarseLights, groups: Sequence[Group], fine: Cells, kernels: StreakKernels
) -> FloatArray:
    """Return the lights of one colour in a window, in cells of 2 px.

    Args:
        colour: Which.
        lights: Its lights in cells of 4 px.
        groups: Of `groups_of`, within the window.
        fine: The whole capture in cells of 2 px.
        kernels: For its cells.
    """
    place = lights.window.finer(fine.light.shape[-2:])
    clipped = fine.clipped[(colour, *place.at)] > 0
    light = np.zeros(place.shape, np.float32)
    for group in groups:
        near = group.window.finer(place.shape)
        clipped_cells = repeated(group.cells, near.shape) & clipped[near.at]
        if not clipped_cells.any():
            continue
        coarse = np.where(group.cells, lights.light[group.window.at], 0).astype(np.float32)
        mine = spreading(kernels.coarse.whole[colour], coarse > 0).spread(coarse)
        other_light = lights.veil[group.window.at] + lights.blurred[group.window.at] - mine
        measured = fine.light[(colour, *near.shifted(place.top, place.left).at)]
        light[near.at] += seek_lights(
            measured - upsampled(other_light, near.shape),
            clipped_cells,
            spreading(kernels.fine.whole[colour], clipped_cells, often=True),
            with_means(np.where(clipped_cells, dome(lights.rim_px[near.at]), 0), coarse),
            FINE_STEPS,
            hidden=clipped[near.at],
        )
    return np.where(clipped, np.maximum(light, np.float32(FAINTEST)), 0)
