"""The coarse band of optics with a haze: what wide kernels do to a picture, undone in cells.

    capture y -> cells y_c -> x_c: y_c = H x_c solved in a few rounds
    z = (y - y_c) H1 / E1 + E x_c / E1

E is the blur by the cores and H that by cores and haze, each with the light that they hold; H1 and
E1 are what they make of a picture of ones, by which everything is divided, so that equal radiance
stays equal. z is as blurred as the core kernels (of sum 1) blur; its noise is raised by H1 / E1. In
cells it is what the solution says, and within them the capture's own detail, whose light lies in
the cores. Taking H x_c away from y and not the cells' own mean would be the same, but for what is
wrong with the solution: an error of 1 % there were 3 % of the level (docs/decisions: the haze is
undone in cells).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.haze import Haze
from camkit.psf import FrozenPsf, depth_weights
from camkit.runtime.bank.cell_means import cell_count
from camkit.runtime.bank.place_blur import (
    FewKernels,
    NodeKernels,
    PlaceBlur,
    few_kernels,
    lay_nodes,
)
from camkit.runtime.bank.place_undo import cores_differ, undoing_kernels
from camkit.runtime.bank.psf import FieldKernels, color_kernels, wavelength_weights
from camkit.runtime.geometry.sensor_window import SensorWindow

MARGIN_CELLS: Final = 16
"""Of the scene around the capture, mirrored: its light hazes the rim."""
DAMPING: Final = 1e-3
CORE_TERMS: Final = 16
LEAST_RESPONSE: Final = 1e-3
"""Of a picture of ones, in a cell that hardly any light reaches."""

KEPT_CAMERAS: Final = 2
KEPT_TERMS: Final = 2 * KEPT_CAMERAS
"""What is computed of optics once and kept by a process: with and without the haze."""

FloatGrid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class HazyKernels:
    """Core and haze of the colours, and the light that each holds.

    Attributes:
        core: Core kernels in pixels, of sum 1.
        coarse_core: The same in cells, with its light.
        haze: What lies beside it in cells, with its light.
        coarse: Core and haze in cells, with their light.
        cell_px: Side of a cell.
        differ: Whether cores hold so different shares that every place needs a filter of its own.
    """

    core: FieldKernels
    coarse_core: "LightKernels"
    haze: "LightKernels"
    coarse: "LightKernels"
    cell_px: int
    differ: bool = False

    def scaled(self, ratio: float) -> "HazyKernels":
        """Return the kernels scaled about their centres; see `FieldKernels.scaled`."""
        return HazyKernels(
            core=self.core.scaled(ratio),
            coarse_core=self.coarse_core.scaled(ratio),
            haze=self.haze.scaled(ratio),
            coarse=self.coarse.scaled(ratio),
            cell_px=self.cell_px,
            differ=self.differ,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightKernels:
    """Kernels of sum 1, and the light that they hold.

    Attributes:
        kernels: (field, c, n, n).
        light: (field, c) float64.
    """

    kernels: FieldKernels
    light: FloatGrid

    def at(self, x_mm: float, y_mm: float) -> FloatArray:
        """Return the kernels (c, n, n) of an image point, with their light."""
        return self.kernels.at(x_mm, y_mm) * self.light_at(x_mm, y_mm)[:, None, None]

    def outward(self, x_mm: float, y_mm: float) -> FloatArray:
        """Return them with +y pointing outward; see `FieldKernels.outward`."""
        return self.kernels.outward(x_mm, y_mm) * self.light_at(x_mm, y_mm)[:, None, None]

    def light_at(self, x_mm: float, y_mm: float) -> FloatArray:
        """Return the light (c,) of an image point, interpolated as the kernels are."""
        return self.kernels.interpolate(self.light, x_mm, y_mm)

    def scaled(self, ratio: float) -> "LightKernels":
        """Return the kernels scaled about their centres; see `FieldKernels.scaled`."""
        return LightKernels(kernels=self.kernels.scaled(ratio), light=self.light)


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseBand:
    """The factor and the veil of a capture, by cell: z = gain y + veil.

    Attributes:
        gain: (c, h, w) float32, H1 / E1.
        veil: (c, h, w) float32, E x / E1 - gain y.
        picture: (c, h, w) float32, x: the scene in cells.
        cell_px: Side of a cell; the last row and column may be up to half narrower or wider.
    """

    gain: FloatArray
    veil: FloatArray
    picture: FloatArray
    cell_px: int

    @property
    def noise_rise(self) -> tuple[float, ...]:
        """Return the factor on the variance of the noise of every colour, on average."""
        square = np.square(self.gain, dtype=np.float64).mean(axis=(-2, -1))
        return tuple(float(v) for v in square)

    def clear(self, rows: FloatArray, top: int) -> None:
        """Remove the haze from rows (c, n, w) of the capture, in place.

        Args:
            rows: From row `top` on.
            top: Number of the first.
        """
        down = np.arange(top, top + rows.shape[1])
        across = np.arange(rows.shape[2])
        for channel, (gain, veil) in enumerate(zip(self.gain, self.veil, strict=True)):
            rows[channel] *= enlarged(gain, self.cell_px, down, across)
            rows[channel] += enlarged(veil, self.cell_px, down, across)


def enlarged(
    cells: FloatArray, cell_px: int, down: NDArray[np.intp], across: NDArray[np.intp]
) -> FloatArray:
    """Return a picture in cells (h, w) at pixels, linear between the middles of the cells.

    Args:
        cells: Its border holds beyond them.
        cell_px: Side of a cell.
        down: (n,) rows.
        across: (m,) columns.

    Returns:
        (n, m) float32.
    """
    (top, lower), (left, right) = (
        _middles(at, side, cell_px)
        for at, side in ((down, cells.shape[0]), (across, cells.shape[1]))
    )
    above, below = cells.take(top, axis=0), cells.take(np.minimum(top + 1, len(cells) - 1), axis=0)
    below -= above
    below *= lower[:, None]
    above += below
    picture = above.take(left, axis=1)
    step = above.take(np.minimum(left + 1, cells.shape[1] - 1), axis=1)
    step -= picture
    step *= right
    picture += step
    return np.asarray(picture)


def _middles(at: NDArray[np.intp], cells: int, cell_px: int) -> tuple[NDArray[np.intp], FloatArray]:
    place = np.clip((at + 0.5) / cell_px - 0.5, 0, cells - 1)
    first = np.floor(place).astype(np.intp)
    return first, (place - first).astype(np.float32)


def hazy_kernels(
    psf: FrozenPsf,
    haze: Haze,
    wavelengths_um: FloatGrid,
    response: FloatGrid,
    *,
    depth_mm: float | None = None,
) -> HazyKernels:
    """Weight core and haze into one of each per field and channel.

    Args:
        psf: Core kernels.
        haze: What lies beside them.
        wavelengths_um: (n,) grid of the response.
        response: (channel, n) response of the channels.
        depth_mm: Object distance, see `depth_weights`; None for the mean over the depths.

    Raises:
        ContractError: If the PSF does not reach the depth, or the response does not fit.
    """
    haze.check_beside(psf)
    core = color_kernels(psf, wavelengths_um, response, depth_mm=depth_mm, share=haze.core_share)
    weights = wavelength_weights(psf.wavelengths_um, wavelengths_um, response)
    shares = depth_weights(psf.depths_mm, depth_mm)
    light = np.einsum("fdw,d,cw->fc", haze.core_share, shares, weights)
    wide = np.einsum("fdwij,d,cw->fcij", haze.kernels, shares, weights, optimize=True)
    if psf.symmetry == "radial":
        wide = 0.5 * (wide + wide[..., ::-1])
    narrow = in_cells(core.kernels, haze.cell_px) * light[..., None, None]
    return HazyKernels(
        core=core,
        coarse_core=_light_kernels(narrow, core),
        haze=_light_kernels(wide, core),
        coarse=_light_kernels(_added(wide, narrow), core),
        cell_px=haze.cell_px,
        differ=cores_differ(haze),
    )


def in_cells(kernels: FloatArray, cell_px: int) -> FloatGrid:
    """Return kernels in cells: the mean over points spread evenly over the middle cell.

    Args:
        kernels: (..., h, w) in pixels, odd sides.
        cell_px: Side of a cell.

    Returns:
        (..., n, n) float64, n odd, of the same sums.
    """
    half = max(kernels.shape[-2:]) // 2
    reach = -(-(half + cell_px) // cell_px) - 1
    cells = np.arange(-reach, reach + 1) * cell_px

    def falls(side: int) -> FloatGrid:
        offset = np.arange(side) - side // 2
        return np.asarray(np.maximum(1 - np.abs(offset - cells[:, None]) / cell_px, 0))

    height, width = kernels.shape[-2:]
    return np.asarray(falls(height) @ kernels @ falls(width).T, np.float64)


def _added(wide: FloatGrid, narrow: FloatGrid) -> FloatGrid:
    """Add kernels about one middle, of two sides."""
    small, large = sorted((wide, narrow), key=lambda kernel: kernel.shape[-1])
    at = (large.shape[-1] - small.shape[-1]) // 2
    total = np.array(large)
    total[..., at : at + small.shape[-1], at : at + small.shape[-1]] += small
    return total


def _light_kernels(kernels: FloatGrid, like: FieldKernels) -> LightKernels:
    light = kernels.sum(axis=(-2, -1))
    # a kernel without light is even
    even = 1 / kernels[0, 0].size
    unit = np.full(kernels.shape, even)
    np.divide(kernels, light[..., None, None], out=unit, where=light[..., None, None] > 0)
    return LightKernels(
        kernels=FieldKernels(
            kernels=unit.astype(np.float32),
            field_heights_mm=like.field_heights_mm,
            symmetry=like.symmetry,
            grid_x_mm=like.grid_x_mm,
            grid_y_mm=like.grid_y_mm,
        ),
        light=light,
    )


def cell_window(window: SensorWindow, cell_px: int, margin: int) -> SensorWindow:
    """Return the window of a capture's cells on the sensor, with some around them."""
    width, height = (cell_count(side, cell_px) for side in window.size_px)
    return window.resampled(cell_px, (width, height)).widened(margin)


def solve_coarse(
    cells: FloatArray,
    clipped: NDArray[np.bool_],
    kernels: HazyKernels,
    window: SensorWindow,
    *,
    terms: int,
    rounds: int,
    threads: int = 1,
) -> CoarseBand:
    """Find the scene in cells behind a capture in cells, and how the capture is cleared by it.

    Args:
        cells: (c, h, w) float32, the capture's means.
        clipped: (c, h, w), where a sample clipped: the light was at least so bright.
        kernels: Of the camera.
        window: Of the capture in pixels.
        terms: See `PlaceBlur`.
        rounds: Of adding what a filter makes of what is left unexplained: that of the mean kernel,
            or where cores differ much, of the kernel of every place (`place_undo`).
        threads: Threads to compute with; no influence on the bits.

    Raises:
        Cancelled: If the caller of what this thread works at wished so.
    """
    margin_window = cell_window(window, kernels.cell_px, MARGIN_CELLS)
    inner = np.s_[MARGIN_CELLS:-MARGIN_CELLS, MARGIN_CELLS:-MARGIN_CELLS]
    nodes = lay_nodes(kernels.core, margin_window)
    wide = few_of(kernels.coarse, terms)
    narrow = few_of(kernels.coarse_core, CORE_TERMS)
    filters = filters_of(kernels.coarse, terms) if kernels.differ else None
    gain, veil, picture = (np.empty(cells.shape, np.float32) for _ in range(3))
    for channel, (plane, mask) in enumerate(zip(cells, clipped, strict=True)):
        blur = PlaceBlur(wide[channel], nodes, threads=threads)
        ones = np.ones(margin_window.size_px[::-1], np.float32)
        even = np.maximum(blur(ones)[inner], np.float32(LEAST_RESPONSE))
        undo: Callable[[FloatArray], FloatArray]
        if filters is None:
            undo = blur.solver(DAMPING)
        else:
            undo = PlaceBlur(filters[channel], nodes, threads=threads)
        scene = _mirrored(plane)
        for _ in range(rounds):
            residual = plane - blur(scene)[inner] / even
            np.maximum(residual, 0, out=residual, where=mask)
            scene += undo(_mirrored(residual))
        core = PlaceBlur(narrow[channel], nodes, threads=threads)
        core_response = np.maximum(core(ones)[inner], np.float32(LEAST_RESPONSE))
        gain[channel] = even / core_response
        veil[channel] = core(scene)[inner] / core_response - gain[channel] * plane
        picture[channel] = scene[inner]
    return CoarseBand(gain=gain, veil=veil, picture=picture, cell_px=kernels.cell_px)


@lru_cache(maxsize=KEPT_TERMS)
def few_of(kernels: LightKernels, terms: int) -> tuple[FewKernels, ...]:
    """Return the few kernels of every channel; kept, since all captures of a camera need them."""
    nodes = NodeKernels(kernels.kernels, kernels.light)
    return tuple(few_kernels(nodes.of(c), terms) for c in range(kernels.light.shape[1]))


def few_are_kept() -> bool:
    """Return whether this process has found few kernels of any camera already."""
    return few_of.cache_info().currsize > 0


@lru_cache(maxsize=KEPT_CAMERAS)
def filters_of(kernels: LightKernels, terms: int) -> tuple[FewKernels, ...]:
    """Return few kernels of the filters of every channel, see `place_undo`; kept as `few_of`."""
    nodes = NodeKernels(kernels.kernels, kernels.light)
    channels = range(kernels.light.shape[1])
    return tuple(few_kernels(undoing_kernels(nodes.of(c)), terms) for c in channels)


def _mirrored(cells: FloatArray) -> FloatArray:
    """Return the cells with a mirrored margin; a single row or column goes on as it is."""
    if min(cells.shape) < 2:
        return np.pad(cells, MARGIN_CELLS, mode="edge")
    return np.pad(cells, MARGIN_CELLS, mode="reflect")
