"""The light around a place of a merged bracket, colour by colour, with its noise and its black."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.calibration.lattice import FloatGrid, Lattice, filled
from camkit.calibration.light import LightCore, background, border
from camkit.caller import option_text
from camkit.cfa import cfa_channels
from camkit.errors import DecodeError
from camkit.runtime.merging.merge import Merged
from camkit.runtime.merging.survey import Survey

CHANNELS: Final = (2, 1, 0)
RED: Final = 2
"""Its place among them."""
BORDER_PX: Final = 12
RING: Final = (0.5, 0.75)
"""Of the way to the border: where haze is looked for."""
HAZE_SPREADS: Final = 6.0
MOST_HAZE: Final = 0.01
"""Of the light, that may lie below what is taken for the background."""


class Patch:
    """The light around a place, less its background.

    Attributes:
        top, left: Of the patch in the frames, both even.
        light: Of each colour: blue, green, red.
        variance: Likewise.
        floors: Spread of the dark around, of each colour.
        level_errors: Standard error of what was taken for dark, of each colour.
    """

    def __init__(
        self,
        merged: Merged,
        survey: Survey,
        place: tuple[int, int],
        half: int,
        black_error: float | None,
    ) -> None:
        """Cut the patch out.

        Args:
            merged: The bracket.
            survey: What is known of it.
            place: (row, column) of its middle.
            half: How far it is needed to every side.
            black_error: Of the level of dark frames that were taken off, in `merged`'s unit: then
                nothing else is. None where there were none, and what lies along the border is
                dark.

        Raises:
            DecodeError: If veiling glare fills the frame and nothing says what dark is.
        """
        reach = half + BORDER_PX
        # an even first row and column keep the phase of the mosaic
        self.top, self.left = (max(0, n - reach) // 2 * 2 for n in place)
        inside = (
            slice(None),
            slice(self.top, place[0] + reach + 2),
            slice(self.left, place[1] + reach + 2),
        )
        precision = merged.precision[inside].astype(np.float64)
        light = merged.light[inside].astype(np.float64)
        self._missing = precision <= 0
        light[self._missing] = np.nan
        variance = np.where(self._missing, np.nan, 1 / np.maximum(precision, 1e-300))
        self.light: list[Lattice] = []
        self.variance: list[Lattice] = []
        self.floors: list[float] = []
        self.level_errors: list[float] = []
        for channel in CHANNELS:
            planes = _planes(merged, survey, channel)
            level, spread = background([plane for plane, _, _ in planes])
            error = spread / np.sqrt(sum(plane.size for plane, _, _ in planes) / 4)
            if black_error is None:
                _refuse_haze(planes, place, level, spread)
            else:
                level, error = 0.0, float(np.hypot(error, black_error))
            lattice = _lattice(light, survey, channel)
            self.light.append(lattice.with_values(lattice.values - level))
            self.variance.append(_lattice(variance, survey, channel))
            # noise finer than the steps of a converter shows no spread
            self.floors.append(max(spread, float(np.sqrt(np.nanmedian(self.variance[-1].values)))))
            self.level_errors.append(float(error))
        self.place = place[0] - self.top, place[1] - self.left

    def red(self, half: int, core: LightCore) -> FloatGrid:
        """Return the light of red as its samples lie, up to so many pixels from a core."""
        lattice = self.light[RED]
        y, x = lattice.places()
        inside = np.maximum(np.abs(y - core.y), np.abs(x - core.x)) <= half
        rows, columns = (np.flatnonzero(inside.any(axis=n)) for n in (1, 0))
        return filled(lattice.values[np.ix_(rows, columns)])

    def filled_samples(self, half: int, core: LightCore) -> int:
        """Count the samples of the crop that no frame holds."""
        y, x = np.indices(self._missing.shape[-2:])
        inside = np.maximum(np.abs(y - core.y), np.abs(x - core.x)) <= half
        return int(np.count_nonzero(self._missing & inside))


def cells(merged: Merged, survey: Survey) -> FloatArray:
    """Return the light of whole cells: the sum of the planes, or of the 2x2 of a mosaic."""
    light = merged.light
    if survey.like.cfa is None:
        return np.asarray(light.sum(axis=0))
    height, width = (n // 2 * 2 for n in light.shape[1:])
    even = light[0, :height, :width]
    return np.asarray(even.reshape(height // 2, 2, width // 2, 2).sum(axis=(1, 3)))


def _lattice(planes: FloatGrid, survey: Survey, channel: int) -> Lattice:
    """Return the lattice of a channel of (1 or 3, h, w)."""
    cfa = survey.like.cfa
    if cfa is None:
        return Lattice.of_plane(planes[channel])
    return Lattice.of_mosaic(planes[0], cfa, channel)


_Plane = tuple[FloatArray, int, tuple[int, int]]


def _planes(merged: Merged, survey: Survey, channel: int) -> list[_Plane]:
    """Return the light of a channel by its places in the cell, NaN where none is known.

    With each come its pitch in pixels and its first (row, column).
    """
    usable = np.where(merged.precision > 0, merged.light, np.float32(np.nan))
    if survey.like.cfa is None:
        return [(usable[channel], 1, (0, 0))]
    cell = np.array(cfa_channels(survey.like.cfa))
    return [(usable[0, y::2, x::2], 2, (int(y), int(x))) for y, x in np.argwhere(cell == channel)]


def _refuse_haze(
    planes: Sequence[_Plane], place: tuple[int, int], level: float, spread: float
) -> None:
    """Refuse a background that is haze: farther inside it is brighter.

    Raises:
        DecodeError: If so.
    """
    samples, total, ring = 0.0, 0.0, list[FloatArray]()
    for plane, pitch, first in planes:
        y, x = (
            pitch * np.arange(n) + start - at
            for n, start, at in zip(plane.shape, first, place, strict=True)
        )
        distance = np.hypot(y[:, None], x[None])
        reach = min(-y[0], y[-1], -x[0], x[-1])
        finite = np.isfinite(plane)
        ring.append(plane[finite & (distance > RING[0] * reach) & (distance < RING[1] * reach)])
        total += float((plane[finite & (distance < reach)].astype(np.float64) - level).sum())
        samples += np.pi * (reach / pitch) ** 2
    values = np.concatenate(ring)
    if values.size < BORDER_PX:
        return
    # streaks are bright and narrow, haze lifts the darker half too
    rise = _darker_half(values) - _darker_half(np.concatenate([p[border(p)] for p, _, _ in planes]))
    if rise > HAZE_SPREADS * spread / np.sqrt(values.size) and rise * samples > MOST_HAZE * total:
        raise DecodeError(
            f"veiling glare fills the frame: {rise * samples / max(total, 1e-300):.0%} of the "
            "light or more cannot be told from the background; give frames without light by "
            f"{option_text('dark')}"
        )


def _darker_half(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite[finite <= np.median(finite)].mean(dtype=np.float64))
