"""Dense kernels as the cells of each colour see them, and what of them is core."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS, Sites, cell_kernel, coarser_kernel

CORE_CELLS: Final = {1: 4.0, 2: 2.0, 4: 1.0}
"""Pitch in pixels -> what lies this far from the middle, in cells, is no veil but blur."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellKernels:
    """The kernels of one pitch.

    Attributes:
        pitch_px: Of the cells.
        whole: For every colour (n, n) float32, n odd: what a cell's light becomes.
        veil: The same without its core.
        core: (3,): share of the light in the core.
    """

    pitch_px: int
    whole: tuple[FloatArray, ...]
    veil: tuple[FloatArray, ...]
    core: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StreakKernels:
    """The kernels of a camera for the cells of a capture.

    Attributes:
        sites: Where each colour has its samples.
        pixel: Of pixels.
        fine: Of cells of 2 px.
        coarse: Of cells of 4 px.
        reach_px: How far arms reach.
    """

    sites: tuple[Sites, ...]
    pixel: CellKernels
    fine: CellKernels
    coarse: CellKernels
    reach_px: int


def streak_kernels(kernels: FloatArray, sites: tuple[Sites, ...], reach_px: int) -> StreakKernels:
    """Return the kernels for the cells of a capture.

    Args:
        kernels: (3, n, n) dense kernels of the colours in pixels, n odd; shares of the light.
        sites: Samples of each colour in a cell; see `cells.sample_sites`.
        reach_px: How far arms reach.

    Raises:
        ContractError: If there is not one kernel with a middle per colour.
    """
    if kernels.ndim != 3 or kernels.shape[0] != COLOURS or kernels.shape[1] % 2 == 0:
        raise ContractError(f"kernels must be (3, n, n), n odd; got {kernels.shape}")
    fine = [cell_kernel(k, places) for k, places in zip(kernels, sites, strict=True)]
    coarse = [coarser_kernel(k) for k in fine]
    return StreakKernels(
        sites=sites,
        pixel=_split(list(kernels), 1),
        fine=_split(fine, 2),
        coarse=_split(coarse, 4),
        reach_px=reach_px,
    )


def _split(kernels: list[FloatArray], pitch_px: int) -> CellKernels:
    cores = [np.where(_distance(k.shape[0]) <= CORE_CELLS[pitch_px], k, 0) for k in kernels]
    return CellKernels(
        pitch_px=pitch_px,
        whole=tuple(kernels),
        veil=tuple(k - core for k, core in zip(kernels, cores, strict=True)),
        core=tuple(float(core.sum(dtype=np.float64)) for core in cores),
    )


def _distance(side: int) -> FloatArray:
    place = np.arange(side, dtype=np.float32) - side // 2
    return np.hypot(place[:, None], place[None, :])
