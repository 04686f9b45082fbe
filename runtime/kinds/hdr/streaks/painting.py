"""A recovery in cells, painted over pixels: lights are added, their streaks are removed.

    veil of cells, streaks of lights -> taken from rows of pixels
    lights of pixels                 -> put there, in colours that the output has

    or, where a mosaic is at hand:
    veil and streaks -> taken from its samples, as far as they are known; then it is demosaicked
    lights of pixels -> put there in the colour of their lamp, pixels beside them in the scene's

Every pixel follows from the cells and its own place alone: bands of any height have the same bits.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import Matrix, OutputColours
from camkit.runtime.kinds.hdr.streaks.cell_rows import Lattice
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS, PITCH_PX, Sites
from camkit.runtime.kinds.hdr.streaks.doubt import settled
from camkit.runtime.kinds.hdr.streaks.recovery import Recovery
from camkit.runtime.kinds.hdr.streaks.rims import colour_by_surroundings, in_own_colours
from camkit.runtime.kinds.hdr.streaks.spots import lit_pixels
from camkit.runtime.kinds.hdr.streaks.streak_rows import streaks_of

DIMMEST: Final = 0.1
"""Of its strongest colour: lights have no less of any in the colours of the output."""
DARKEST: Final = 0.015
"""Below black, of where samples clip: more than three standard deviations of the noise of dark
samples at ISO 6400."""
_NO_CHANGE: Final = np.eye(3)
Mask = NDArray[np.bool_]
Index = NDArray[np.int32]


class Painter:
    """Lays a recovery over the rows of a picture; keeps no more of it than that needs.

    Attributes:
        blind: Whether all lights are left as the sensor saw them.
    """

    def __init__(self, recovery: Recovery, to_output: Matrix = _NO_CHANGE) -> None:
        """Prepare the lights.

        Args:
            recovery: Of the capture.
            to_output: (3, 3) from colours multiplied by the gains to linear Rec.709, in which no
                light is negative.
        """
        self._lit = lit_pixels(recovery)
        self._colours = OutputColours(to_output)
        self._veil = recovery.veil
        self._veil_grid = recovery.coarse.pitch_px, recovery.coarse.offset_px
        self._streaks = streaks_of(recovery, self._lit)
        self._core = recovery.core
        self.blind = recovery.blind

    def paint(self, planes: FloatArray, top: int, gains: tuple[float, ...]) -> None:
        """Change rows of a picture in place.

        Args:
            planes: (3, rows, w) float32, full colour, multiplied by the gains.
            top: Number of the first row.
            gains: Of the colours.
        """
        rows, width = planes.shape[1:]
        for colour, gain in enumerate(gains):
            glare = self._glare(colour, Lattice(top=top), (rows, width))
            glare *= np.float32(gain)
            planes[colour] -= glare
            planes[colour] *= np.float32(1 / self._core[colour])
        self._put_lights(planes, top, gains)

    def clear(
        self,
        samples: FloatArray,
        clipped: Mask,
        top: int,
        sites: Sequence[Sites],
        gains: Sequence[float] = (1.0,) * COLOURS,
    ) -> None:
        """Remove veil and streaks from rows of a mosaic in place, with their uncertainty.

        Args:
            samples: (rows, w) float32, multiplied by the gains; see `doubt.settled` for the rows.
            clipped: (rows, w).
            top: Number of the first row.
            sites: Of every colour in a cell of 2 px.
            gains: Of the colours; without them 1.0 = where samples clip.
        """
        for colour, places in enumerate(sites):
            at = [np.s_[y::PITCH_PX, x::PITCH_PX] for y, x in places]
            lattices = [Lattice(top=top + y, left=x, step_px=PITCH_PX) for y, x in places]
            glares = [
                self._glare(colour, lattice, samples[there].shape)
                for lattice, there in zip(lattices, at, strict=True)
            ]
            light = np.float32(1 / gains[colour])
            rest = [samples[there] * light - glare for there, glare in zip(at, glares, strict=True)]
            cleared = settled(rest, glares, [clipped[there] for there in at])
            for there, plane in zip(at, cleared, strict=True):
                samples[there] = plane * np.float32(gains[colour] / self._core[colour])

    def light_up(
        self, planes: FloatArray, clipped: Mask, top: int, gains: tuple[float, ...]
    ) -> None:
        """Paint lights in colours of their own into rows of a cleared picture, in place.

        Args:
            planes: As `paint`; see `rims.colour_by_surroundings` for the rows.
            clipped: (rows, w): whose own sample clipped.
            top: Number of the first row.
            gains: Of the colours.
        """
        if clipped.any():
            lit = np.zeros(clipped.shape, np.bool_)
            lit[self._lit_within(top, len(lit))[1]] = True
            colour_by_surroundings(planes, clipped, lit)
        # a demosaic may overshoot at an edge; noise alone reaches a little below black
        for plane, gain in zip(planes, gains, strict=True):
            np.maximum(plane, np.float32(-DARKEST * gain), out=plane)
        self._put_lights(planes, top, gains, own_colours=True)

    def _glare(self, colour: int, lattice: Lattice, shape: tuple[int, ...]) -> FloatArray:
        """Return veil and streaks at the pixels of a lattice (rows, columns)."""
        pitch_px, offset_px = self._veil_grid
        glare = lattice.cells(self._veil[colour], pitch_px, offset_px[colour], shape)
        for streaks in self._streaks:
            streaks.add(glare, colour, lattice)
        return glare

    def _lit_within(self, top: int, rows: int) -> tuple[slice, tuple[Index, Index]]:
        """Return the lit pixels of some rows, and their places."""
        lit = self._lit
        first, last = np.searchsorted(lit.rows, [top, top + rows])
        return slice(first, last), (lit.rows[first:last] - top, lit.columns[first:last])

    def _put_lights(
        self, planes: FloatArray, top: int, gains: tuple[float, ...], *, own_colours: bool = False
    ) -> None:
        which, at = self._lit_within(top, planes.shape[1])
        if which.start == which.stop:
            return
        levels = np.array(gains, np.float32)[:, None]
        light = self._lit.light[:, which] * levels
        lit = light > 0
        there = np.where(lit, light, planes[:, *at])
        if own_colours:
            there = in_own_colours(there, lit, self._lit.excess[:, which] * levels, levels)
        there = _untinted(there, lit)
        planes[:, *at] = _visible(there, self._colours)


def _untinted(light: FloatArray, lit: NDArray[np.bool_]) -> FloatArray:
    """Raise what clipped to the darker of the other colours where one of these was seen.

    Which colours clip changes from pixel to pixel at the rim of a lamp: whatever is raised from
    white by too little there is tinted, green that clipped first makes it purple.

    Args:
        light: (3, n), multiplied by the gains.
        lit: (3, n): which colours clipped.
    """
    has_unclipped = ~lit.all(axis=0)
    out = light.copy()
    for colour in range(COLOURS):
        others = np.delete(light, colour, axis=0).min(axis=0)
        out[colour] = np.where(
            lit[colour] & has_unclipped, np.maximum(light[colour], others), light[colour]
        )
    return out


def _visible(light: FloatArray, colours: OutputColours) -> FloatArray:
    """Raise colours that were sought apart to where the output has them; (3, n) light."""
    output_light = colours.of(light)
    least = np.float32(DIMMEST) * output_light.max(axis=0)
    return colours.raised(
        light, np.where((output_light > 1).any(axis=0), least, np.float32(-np.inf))
    )
