"""The streaks of a picture, found from it and taken out of it.

    rows -> overview -> direction -> slant -> amounts and fading, in turns -> streaks of the slant
    rows, streaks of the slant -> rows without them

Work grows with the columns that lights stand in. Where nothing can be told, nothing is changed and
a note says why.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.deglare.arms import (
    LAST_SCALES,
    SCALES,
    Amounts,
    Columns,
    Labels,
    Mask,
    arm_streaks,
    fields_of,
    runs_of,
    seek_arms,
)
from camkit.runtime.kinds.hdr.deglare.direction import Direction, find_direction
from camkit.runtime.kinds.hdr.deglare.overview import overview_of
from camkit.runtime.kinds.hdr.deglare.profile import first_fading, fitted_fading
from camkit.runtime.kinds.hdr.deglare.slant import Slant

COLOURS: Final = 3
SLANT_ROWS: Final = 96
"""Of a slant, about."""
MOST_LIT: Final = 0.3
"""Share of a picture; where more is light, streaks cannot be told from what they fall on."""
GROWN_PX: Final = 3
"""Columns beside a light that throw light too: its rim is dimmer than a light."""
TURNS: Final = 2
DARK: Final = 0.02
LEVEL_SHARE: Final = 0.3
LEVEL_SIGMA: Final = (2.0, 8.0)
SURROUNDINGS_SIGMA: Final = (1.0, 3.0)
SURROUNDINGS_PX: Final = 17
_LEAST_LIT: Final = 0.02
_WHOLE: Final = 0.99
_FEW: Final = 0.1
Read = Callable[[int, int], FloatArray]
Open = Callable[[], Read]
"""Begins to read a picture from its top."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GlareSettings:
    """The settings of the search for streaks.

    Attributes:
        least_rad: Least angle of streaks from the vertical, to either side.
        most_rad: Largest.
        reach: How far arms reach, as a share of the diagonal of the picture.
        level: Light is what reaches this share of where a colour clips.
    """

    least_rad: float
    most_rad: float
    reach: float
    level: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Glare:
    """The streaks of a picture.

    Attributes:
        settings: What was looked for.
        direction: None where no streaks were found.
        slant: Where they stand upright; None likewise.
        streaks: (3, *slant.shape) float32, what is taken away; 1.0 = where a colour clips.
        floor: (3, *slant.shape) float32: no pixel is made darker than that.
        lit_fraction: Share of the picture that is light.
        notes: What the user should know.
    """

    settings: GlareSettings
    direction: Direction | None
    slant: Slant | None
    streaks: FloatArray
    floor: FloatArray
    lit_fraction: float
    notes: tuple[str, ...] = ()

    def paint(self, planes: FloatArray, top: int, gains: tuple[float, ...]) -> None:
        """Remove the streaks from rows of the picture, in place; its lights stay as they are.

        Args:
            planes: (3, rows, width) float32, multiplied by the gains.
            top: Number of the first row.
            gains: Of the colours.
        """
        if self.slant is None:
            return
        gain = np.array(gains, np.float32)[:, None, None]
        rows = planes.shape[1]
        streaks = self.slant.resampled(self.streaks, top, rows) * gain
        floor = self.slant.resampled(self.floor, top, rows) * gain
        clean = np.maximum(planes - streaks, np.minimum(planes, floor))
        light = (planes >= np.float32(self.settings.level) * gain).any(axis=0)
        np.copyto(planes, clean, where=~light)

    def to_json(self) -> dict[str, float | None]:
        """Return the values for a sidecar."""
        direction = self.direction
        return {
            "angle_deg": None if direction is None else round(math.degrees(direction.angle_rad), 3),
            "agreement": 0.0 if direction is None else round(direction.agreement, 3),
            "significance": 0.0 if direction is None else round(direction.significance, 2),
            "lit_fraction": round(self.lit_fraction, 6),
            "streak_peak": round(float(self.streaks.max(initial=0.0)), 4),
        }


def find_glare(
    opened: Open,
    height: int,
    width: int,
    settings: GlareSettings,
    pause: Callable[[], None] | None = None,
) -> Glare:
    """Find the streaks of a picture.

    Args:
        opened: Gives what reads rows top..bottom of it, from top to bottom, once: (3, rows, width)
            float32, finite, every colour clips at 1. Called twice at most.
        height: Rows.
        width: Columns.
        settings: What is looked for.
        pause: Called between steps of the work; may raise to stop.
    """
    overview = overview_of(opened(), height, width, settings.level)
    lit = float(overview.lights.mean(dtype=np.float64))
    if not lit:
        return _unchanged(settings, lit, "no light reaches the white level")
    if lit > MOST_LIT:
        return _unchanged(
            settings,
            lit,
            f"{lit:.0%} of the picture is at the white level; streaks are found only up to "
            f"{MOST_LIT:.0%}",
        )
    if pause is not None:
        pause()
    direction = find_direction(overview, settings.least_rad, settings.most_rad)
    if direction is None:
        low, high = (math.degrees(angle) for angle in (settings.least_rad, settings.most_rad))
        return _unchanged(
            settings, lit, f"no streaks at {low:g} to {high:g} degrees from the vertical were found"
        )
    slant = Slant(
        angle_rad=direction.angle_rad,
        height=height,
        width=width,
        step=max(round(height / SLANT_ROWS), 1),
    )
    streaks, floor = _streaks(opened(), slant, settings, pause or _go_on)
    return Glare(
        settings=settings,
        direction=direction,
        slant=slant,
        streaks=streaks,
        floor=floor,
        lit_fraction=lit,
    )


def _go_on() -> None:
    """Skip the check for cancellation."""


def _unchanged(settings: GlareSettings, lit: float, why: str) -> Glare:
    nothing = np.zeros((COLOURS, 0, 0), np.float32)
    return Glare(
        settings=settings,
        direction=None,
        slant=None,
        streaks=nothing,
        floor=nothing,
        lit_fraction=lit,
        notes=(f"no streaks were removed: {why}",),
    )


def _streaks(
    read: Read, slant: Slant, settings: GlareSettings, pause: Callable[[], None]
) -> tuple[FloatArray, FloatArray]:
    """Return the streaks in the slant, and how dark what is left may become."""

    def with_lights(top: int, bottom: int) -> FloatArray:
        band = read(top, bottom)
        lights = (band.max(axis=0) >= settings.level)[None].astype(np.float32)
        return np.concatenate([np.minimum(band, 1), lights])

    slanted, share = slant.gathered(with_lights, COLOURS + 1)
    light = slanted[:COLOURS]
    inside = share > 0
    lights = (slanted[COLOURS] > _LEAST_LIT) & inside
    usable = (share > _WHOLE) & ~scipy.ndimage.maximum_filter(lights, size=3)
    wide = scipy.ndimage.maximum_filter(lights, size=(1, 2 * GROWN_PX + 1)) & inside
    there = np.flatnonzero(scipy.ndimage.maximum_filter(wide.any(axis=0), size=3))
    colours = [_columns(plane, usable, lights, there) for plane in light]
    reach_rows = settings.reach * math.hypot(slant.height, slant.width) / slant.step
    streaks = np.zeros_like(light)
    colour_streaks = _solved(colours, runs_of(wide[:, there]), reach_rows, pause)
    for plane, columns in zip(streaks, colour_streaks, strict=True):
        plane[:, there] = columns.T
    return streaks, np.stack(
        [_surroundings(s - t, usable) for s, t in zip(light, streaks, strict=True)]
    )


def _columns(light: FloatArray, usable: Mask, lights: Mask, there: NDArray[np.intp]) -> Columns:
    """Select the columns that contain lights, and those beside them."""
    dark = np.where(lights, 0, light)
    level = DARK + LEVEL_SHARE * np.maximum(scipy.ndimage.gaussian_filter(dark, LEVEL_SIGMA), 0)
    return Columns(
        light=np.ascontiguousarray(light[:, there].T),
        usable=np.ascontiguousarray(usable[:, there].T),
        level=np.ascontiguousarray(level[:, there].T.astype(np.float32)),
        joined=np.asarray(np.diff(there) == 1),
    )


def _solved(
    colours: list[Columns], runs: Labels, reach_rows: float, pause: Callable[[], None]
) -> list[FloatArray]:
    """Return the streaks (column, row) of every colour: amounts and fading found in turns."""
    fading = first_fading(runs.shape[0], reach_rows)
    amounts: list[Amounts | None] = [None] * len(colours)
    for turn in range(TURNS):
        fields = fields_of(runs, fading)
        new_amounts = []
        for columns, first in zip(colours, amounts, strict=True):
            pause()
            new_amounts.append(seek_arms(columns, fields, LAST_SCALES if turn else SCALES, first))
        amounts = list(new_amounts)
        if turn == TURNS - 1:
            break
        fitted = fitted_fading(colours, runs, new_amounts, fading, reach_rows)
        if fitted is None:
            break
        fading = fitted
    return [arm_streaks(fields, one) for one in new_amounts]


def _surroundings(clean: FloatArray, usable: Mask) -> FloatArray:
    """Return the darkest of the smooth surroundings of every place, never below 0."""
    weight = scipy.ndimage.gaussian_filter(usable.astype(np.float32), SURROUNDINGS_SIGMA)
    smooth = scipy.ndimage.gaussian_filter(np.where(usable, clean, 0), SURROUNDINGS_SIGMA)
    mean = np.divide(smooth, weight, out=np.zeros_like(smooth), where=weight > _FEW)
    least = scipy.ndimage.minimum_filter(mean, size=(1, SURROUNDINGS_PX))
    return np.asarray(np.maximum(least, 0), np.float32)
