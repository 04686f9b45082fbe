"""The streaks of lights over the rows of a picture.

    small windows whose streaks show, colours with many samples
           -> lights of pixels, spread by kernels of pixels
    others -> streaks of cells, linear between their middles

An arm is three pixels wide. In cells of two it is wider and dimmer, and leaves two dark lines and
a bright one where it is removed. In large windows that is the price of their size. Red and blue
of a mosaic have one sample in such a cell and see no more of an arm than it.
"""

from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.cell_rows import Lattice
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS, PITCH_PX
from camkit.runtime.kinds.hdr.streaks.convolution import spreading
from camkit.runtime.kinds.hdr.streaks.recovery import FINE_CELLS, Recovery, Region
from camkit.runtime.kinds.hdr.streaks.regions import Window
from camkit.runtime.kinds.hdr.streaks.spots import LitPixels

FAINT: Final = 0.005
"""Of white: about three standard deviations of the noise of a dark wall at ISO 100."""
BRIGHTEST: Final = 6e4
"""Streaks of pixels are kept in half precision, which ends there: a part in 2,000."""
_LEAST_NORMAL: Final = np.finfo(np.float16).smallest_normal
_SAME_STEP: Final = np.float32(0.75)
"""Single precision has the step here that half precision has below `_LEAST_NORMAL`."""
Half = NDArray[np.float16]


class Streaks(Protocol):
    """The streaks of the lights of a window."""

    def add(self, light: FloatArray, colour: int, lattice: Lattice) -> None:
        """Add it to light (rows, columns) at the pixels of a lattice."""
        ...


def streaks_of(recovery: Recovery, lit: LitPixels) -> list[Streaks]:
    """Return the streaks of all windows.

    Args:
        recovery: Of the capture.
        lit: Its lights.
    """
    fine: list[Streaks] = []
    rough: list[Streaks] = []
    for region in recovery.regions:
        small = region.light[0].size <= FINE_CELLS and _shows(region)
        kernels = recovery.kernels if small else (None,) * COLOURS
        if small:
            fine.append(PixelStreaks(region.window, lit, kernels))
        colours = tuple(colour for colour, kernel in enumerate(kernels) if kernel is None)
        if colours:
            rough.append(CellStreaks(region, recovery.fine.offset_px, colours))
    return fine + rough


class PixelStreaks:
    """Streaks of a small window, pixel by pixel."""

    def __init__(
        self, window: Window, lit: LitPixels, kernels: tuple[FloatArray | None, ...]
    ) -> None:
        """Convolve the lights of a window.

        Args:
            window: In cells of 2 px.
            lit: Lights of the picture.
            kernels: (n, n) of every colour, in pixels: what a light throws beside itself; None
                leaves a colour out.
        """
        self._top, self._left = PITCH_PX * window.top, PITCH_PX * window.left
        # beside the last cell lies a last odd row or column
        height, width = (PITCH_PX * side + 1 for side in window.shape)
        rows, columns = lit.rows - self._top, lit.columns - self._left
        inside = (rows >= 0) & (rows < height - 1) & (columns >= 0) & (columns < width - 1)
        self._planes: list[Half | None] = []
        for light, kernel in zip(lit.light[:, inside], kernels, strict=True):
            plane = np.zeros((height, width), np.float32)
            plane[rows[inside], columns[inside]] = light
            there = plane > 0
            if kernel is None or not there.any():
                self._planes.append(None)
            else:
                self._planes.append(_half(spreading(kernel, there).spread(plane)))

    def add(self, light: FloatArray, colour: int, lattice: Lattice) -> None:
        """Add them to light at the pixels of a lattice."""
        plane = self._planes[colour]
        if plane is None:
            return
        bottom, right = self._top + plane.shape[0], self._left + plane.shape[1]
        at = lattice.pixels_in((self._top, self._left, bottom, right), light.shape)
        first, step, part = lattice.part(at), lattice.step_px, light[at]
        there = plane[first.top - self._top :: step, first.left - self._left :: step]
        part += there[: part.shape[0], : part.shape[1]]


class CellStreaks:
    """Streaks of a window, in cells."""

    def __init__(
        self,
        region: Region,
        offset_px: tuple[tuple[float, float], ...],
        colours: tuple[int, ...] = tuple(range(COLOURS)),
    ) -> None:
        """Store the streaks of cells.

        Args:
            region: The window.
            offset_px: Of the cells of every colour.
            colours: To add.
        """
        self._window, self._offset_px = region.window, offset_px
        self._planes = {c: region.streaks[c] for c in colours if region.streaks[c].any()}

    def add(self, light: FloatArray, colour: int, lattice: Lattice) -> None:
        """Add them to light at the pixels of a lattice."""
        if colour not in self._planes:
            return
        window, offset = self._window, self._offset_px[colour]
        top, left = PITCH_PX * window.top, PITCH_PX * window.left
        bottom, right = PITCH_PX * window.bottom + 1, PITCH_PX * window.right + 1
        at = lattice.pixels_in((top - 1, left - 1, bottom, right), light.shape)
        part = light[at]
        if part.size:
            origin = offset[0] + top, offset[1] + left
            part += lattice.part(at).cells(self._planes[colour], PITCH_PX, origin, part.shape)


def _shows(region: Region) -> bool:
    """Return whether streaks are bright enough, beside what clipped, for their pixels to matter."""
    return bool((region.streaks[region.light == 0] > FAINT).any())


def _half(plane: FloatArray) -> Half:
    """Return a plane in half precision; every subnormal that is not exact would take 80 ns."""
    exact = (plane + _SAME_STEP) - _SAME_STEP
    np.copyto(exact, plane, where=np.abs(plane) >= _LEAST_NORMAL)
    np.copysign(exact, plane, out=exact)  # zeros too
    return np.clip(exact, -BRIGHTEST, BRIGHTEST, out=exact).astype(np.float16)
