"""The haze of a scene: light that falls far from its peaks, spread block by block in cells.

It shares nothing with how haze is undone (`camkit.runtime.bank.place_blur`) but the kernels
and how cells are enlarged.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.bank.haze import enlarged
from camkit.runtime.geometry.field_blur import KernelLookup, scatter_light
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.shrink import shrunk

BLOCK_PX: Final = 256
"""Distance of block centres, each of which has a kernel of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HazeLens:
    """The haze that optics write far from a light.

    Attributes:
        haze_at: Gives the (c, n, n) kernels in cells at a sensor position in millimetres, with
            their light.
        share_at: Gives the (c,) light of the core kernels there.
        cell_px: Side of a cell.
        reach_cells: Half of the largest kernel.
    """

    haze_at: KernelLookup
    share_at: KernelLookup
    cell_px: int
    reach_cells: int


def margin_px(lens: HazeLens, least_px: int) -> int:
    """Return the least margin of whole cells, one at least."""
    return max(-(-least_px // lens.cell_px), 1) * lens.cell_px


def hazed(
    planes: FloatArray,
    lens: HazeLens,
    window: SensorWindow,
    *,
    around_px: int,
    ring_px: int = 0,
    workers: int = 1,
) -> tuple[FloatArray, FloatArray]:
    """Return the haze of a scene, and that of a scene of ones.

    Args:
        planes: (c, h + 2 around, w + 2 around) float32, the scene, mirrored beyond its ring.
        lens: Its haze.
        window: Where the inner h x w pixels lie on the sensor.
        around_px: Whole cells, see `margin_px`.
        ring_px: Of the scene beyond the window; farther out it is mirrored, as far as haze reaches.
        workers: Threads of the FFT.

    Returns:
        Two of (c, h, w) float32.
    """
    cell, reach = lens.cell_px, lens.reach_cells
    cells = shrunk(planes, cell)
    rows, columns = cells.shape[1:]
    width, height = window.size_px
    begin = around_px - ring_px
    down, across = (
        mirrored_cells(count, reach, cell, (begin, begin + side + 2 * ring_px))
        for count, side in ((rows, height), (columns, width))
    )
    wide = cells[:, down[:, None], across]
    first = around_px // cell
    # whole cells from the first of the margin on, which may end beside the window's last
    cell_window = window.resampled(cell, (columns, rows))
    cell_window = SensorWindow(
        size_px=(columns, rows),
        origin_px=(cell_window.origin_px[0] - first, cell_window.origin_px[1] - first),
        sensor_size_px=cell_window.sensor_size_px,
        pitch_um=cell_window.pitch_um,
        axis_px=cell_window.axis_px,
    )
    spread = scatter_light(
        wide,
        lens.haze_at,
        cell_window,
        margin_px=reach,
        step_px=max(BLOCK_PX // cell, 1),
        workers=workers,
    )
    inner = [np.arange(around_px, around_px + side) for side in (height, width)]
    light, ones = (np.stack([enlarged(plane, cell, *inner) for plane in part]) for part in spread)
    return light, ones


def mirrored_cells(
    count: int, margin: int, cell_px: int, scene_px: tuple[int, int]
) -> NDArray[np.intp]:
    """Return the index of each cell of a line that mirrors its scene at the border.

    Args:
        count: Cells of the line, which stand for themselves.
        margin: Cells to add at either end.
        cell_px: Side of a cell.
        scene_px: First pixel of the scene on the line, and one past its last.
    """
    first, end = scene_px
    cells = np.arange(-margin, count + margin)
    length = end - first
    place = ((cells + 0.5) * cell_px - first) % (2 * length)
    mirror = first + np.minimum(place, 2 * length - place)
    inside = (cells >= 0) & (cells < count)
    return np.where(inside, cells, (mirror // cell_px).clip(0, count - 1).astype(np.intp))
