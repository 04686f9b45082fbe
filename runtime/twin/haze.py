"""The haze of a scene: light that falls far from its peaks, spread block by block in cells.

It shares nothing with how haze is undone (`camkit.runtime.bank.place_blur`) but the kernels
and how cells are enlarged.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.contracts import FloatArray
from camkit.runtime.bank.haze import enlarged
from camkit.runtime.geometry.scatter import KernelLookup, scatter_light
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.shrink import shrunk

BLOCK_PX: Final = 256
"""Distance of block centres, each of which has a kernel of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HazeLens:
    """What optics write far from a light.

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
    """Give the least margin of whole cells, one at least."""
    return max(-(-least_px // lens.cell_px), 1) * lens.cell_px


def hazed(
    planes: FloatArray, lens: HazeLens, window: SensorWindow, *, around_px: int, workers: int = 1
) -> tuple[FloatArray, FloatArray]:
    """Give the haze of a scene, and that of a scene of ones.

    Args:
        planes: (c, h + 2 around, w + 2 around) float32, the scene; mirrored beyond.
        lens: Its haze.
        window: Where the inner h x w pixels lie on the sensor.
        around_px: Whole cells, see `margin_px`.
        workers: Threads of the FFT.

    Returns:
        Two of (c, h, w) float32.
    """
    cell, reach = lens.cell_px, lens.reach_cells
    cells = shrunk(planes, cell)
    rows, columns = cells.shape[1:]
    pad = ((0, 0), (reach, reach), (reach, reach))
    wide = np.pad(cells, pad, mode="reflect" if min(rows, columns) > 1 else "edge")
    first = around_px // cell
    width, height = window.size_px
    # whole cells from the first of the margin on, which may end beside the window's last
    laid = window.resampled(cell, (columns, rows))
    laid = SensorWindow(
        size_px=(columns, rows),
        origin_px=(laid.origin_px[0] - first, laid.origin_px[1] - first),
        sensor_size_px=laid.sensor_size_px,
        pitch_um=laid.pitch_um,
        axis_px=laid.axis_px,
    )
    spread = scatter_light(
        wide,
        lens.haze_at,
        laid,
        margin_px=reach,
        step_px=max(BLOCK_PX // cell, 1),
        workers=workers,
    )
    down, across = (np.arange(around_px, around_px + side) for side in (height, width))
    light, ones = (
        np.stack([enlarged(plane, cell, down, across) for plane in part]) for part in spread
    )
    return light, ones
