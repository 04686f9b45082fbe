"""Captures of an array that may not be as its bundle says: what was counted, what is told of it.

    PictureSetting, DepthSetting   what is turned
    PictureShot, DepthShot         counts with the plate and without, beside the truth

The plain array beside has the same pixels without a plate, the same light and the same chance.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

PHOTONS: Final = 1e4
"""Of white, unless a scenario says otherwise."""
DEPTH_PHOTONS: Final = 1000.0
DEPTH_SBR: Final = 3.0
"""Signal of a pixel on average, over background of all its bins."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PictureSetting:
    """Setting by which a picture is counted.

    Attributes:
        kernel: What the plate really does; None for that of the bundle.
        bare_kernel: What the array without a plate sees; None for a point.
        photons: Of white in a pixel.
        plate_light: Share of the light that the plate lets through.
        sbr: Signal over even background, the mean of all pixels; taken off as dark counts.
        dark: (h, w) dark counts; None for none.
        dark_known: Whether they are taken off.
        hot: (h, w) pixels that count far more; None for none.
        hot_counts: What they count without light.
        hot_known: Whether they are painted over.
        white_factor: What networks are told of white, over what the capture shows.
    """

    kernel: FloatArray | None = None
    bare_kernel: FloatArray | None = None
    photons: float = PHOTONS
    plate_light: float = 1.0
    sbr: float = np.inf
    dark: NDArray[np.float64] | None = None
    dark_known: bool = True
    hot: NDArray[np.bool_] | None = None
    hot_counts: float = 0.0
    hot_known: bool = True
    white_factor: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PictureShot:
    """A picture that was counted.

    Attributes:
        scene: Name of what it shows.
        truth: (m h, m w), white = 1.
        counts: (h, w) through the plate.
        bare: (h, w) without it.
        dark: (h, w) counts that are taken off either.
        hot: (h, w) pixels that are painted over in either.
        photons: Of white, without and with the plate.
        white_factor: See `PictureSetting`.
        undisturbed: Way -> mean squared error on the undisturbed capture; None for no chi^2.
    """

    scene: str
    truth: FloatArray
    counts: FloatArray
    bare: FloatArray
    dark: NDArray[np.float64]
    hot: NDArray[np.bool_]
    photons: tuple[float, float]
    white_factor: float = 1.0
    undisturbed: Mapping[str, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DepthSetting:
    """Setting by which surfaces are counted by time.

    Attributes:
        photons: Signal of a pixel on average.
        sbr: Signal over background of all bins.
        axis: As it is; None for that of the bundle.
        pulse: As it is; None for that of the bundle.
        assumed: Axis and pulse that the fit believes; None for those that are.
        behind_ps: How far a second surface lies behind the first, in the middle of the picture.
        chance: Of a photon in the brightest bin and cycle, corrected for; 0 for no pile-up.
        hot: (h, w) pixels that count far more, which nobody states; None for none.
        hot_counts: What they count in a bin.
    """

    photons: float = DEPTH_PHOTONS
    sbr: float = DEPTH_SBR
    axis: TimeAxis | None = None
    pulse: Pulse | None = None
    assumed: tuple[TimeAxis, Pulse] | None = None
    behind_ps: float = 0.0
    chance: float = 0.0
    hot: NDArray[np.bool_] | None = None
    hot_counts: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DepthShot:
    """Surfaces that were counted by time.

    Attributes:
        scene: Name of what it shows.
        times_ps: (returns, m h, m w) true times of flight, the nearer surface first.
        judged: (m h, m w) sub-pixels that count.
        counts: (h, w, bins), pile-up undone.
        blind: (h, w) pixels that pile-up left no counts in some bins.
        cycles: Of the laser, where counts scatter more for pile-up that was undone; else 0.
        axis: As it is believed to be.
        pulse: The same.
    """

    scene: str
    times_ps: NDArray[np.float64]
    judged: NDArray[np.bool_]
    counts: FloatArray
    blind: NDArray[np.bool_]
    cycles: int
    axis: TimeAxis
    pulse: Pulse
