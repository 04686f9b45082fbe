"""Evenness of the limb of a disc: its wobble, the dark seam outside it, the bright rim inside.

    profiles along radii -> where each crosses half of the step -> short waves along the limb
                         -> light must fall all the way out: how far it rises again

A lens draws a disc a little larger, aside or oval, which no eye sees; long waves along the limb are
therefore taken off, and so is what sampling does to the truth.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError

REACH_PX: Final = 24.0
STEP_PX: Final = 0.25
LONGEST_PX: Final = 48.0
"""Waves along the limb up to this length are wobble."""
SAMPLED_PX: Final = 1.0
"""Deviation of the Gaussian that takes the grid of pixels off a limb before its place is read."""
SECTORS: Final = 16
"""A seam is looked for in the mean of each, so that noise is none."""

Grid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limb:
    """Border of a disc.

    Attributes:
        center_px: (y, x).
        radius_px: (n,) at equal steps of the angle.
    """

    center_px: tuple[float, float]
    radius_px: Grid


@dataclass(frozen=True, slots=True, kw_only=True)
class LimbErrors:
    """Errors of a limb.

    Attributes:
        wobble_px: Standard deviation of the place of the half step along the limb.
        seam: How far the picture rises again outside the disc, over the step from sky to disc.
        rim: How far it rises inside the disc before it falls, over the same.
    """

    wobble_px: float
    seam: float
    rim: float


def limb_errors(picture: FloatArray, truth: FloatArray) -> LimbErrors:
    """Measure a limb: wobble of all colours together, seam and rim as the mean of the colours'.

    Args:
        picture: (3, h, w) linear.
        truth: (3, h, w) linear: a bright disc, round or nearly so, of a radius of more than
            `REACH_PX` and as far inside the picture, on a dark sky.
    """
    limb = find_limb(truth)
    radii_px = np.arange(-REACH_PX, REACH_PX + STEP_PX / 2, STEP_PX)
    profiles, true = (_profiles(p, limb, radii_px) for p in (picture, truth))
    inside, outside = true[..., 0].mean(axis=1), true[..., -1].mean(axis=1)
    half = float(np.mean(inside + outside) / 2)
    grey = [scipy.ndimage.gaussian_filter(p.mean(axis=0), SAMPLED_PX) for p in (picture, truth)]
    at, at_first = (crossings(_profiles(p[None], limb, radii_px)[0], radii_px, half) for p in grey)
    sectors = profiles.reshape(len(profiles), SECTORS, -1, radii_px.size).mean(axis=2)
    rim, seam = (
        largest_rise(sectors[..., side]).mean(axis=1) for side in (radii_px < 0, radii_px > 0)
    )
    return LimbErrors(
        wobble_px=wobble(at - at_first, float(limb.radius_px.mean())),
        seam=float(np.mean(seam / (inside - outside))),
        rim=float(np.mean(rim / (inside - outside))),
    )


def find_limb(truth: FloatArray) -> Limb:
    """Find the limb of a bright disc, which distortion may have made oval.

    Raises:
        ContractError: If there is none inside the picture.
    """
    plane = truth.mean(axis=0, dtype=np.float64)
    lit = plane > (plane.min() + plane.max()) / 2
    y, x = (float(v.mean()) for v in np.nonzero(lit))
    radius_px = float(np.sqrt(lit.sum() / np.pi))
    count = SECTORS * max(round(2 * np.pi * radius_px / SECTORS), 1)
    circle = Limb(center_px=(y, x), radius_px=np.full(count, radius_px))
    radii_px = np.arange(-REACH_PX, REACH_PX + STEP_PX / 2, STEP_PX)
    profiles = _profiles(plane[None], circle, radii_px)[0]
    shifts_px = crossings(
        profiles, radii_px, float(profiles[:, 0].mean() + profiles[:, -1].mean()) / 2
    )
    room_px = min(y, x, plane.shape[0] - 1 - y, plane.shape[1] - 1 - x) - radius_px
    if not np.isfinite(shifts_px).all() or min(radius_px, room_px - shifts_px.max()) < REACH_PX:
        raise ContractError(
            f"expected a disc of more than {REACH_PX:g} px radius, as far inside a picture; got "
            f"one of {radius_px:.0f} px around y {y:.0f}, x {x:.0f} of {plane.shape[0]} x "
            f"{plane.shape[1]} px"
        )
    return Limb(center_px=(y, x), radius_px=radius_px + shifts_px)


def crossings(profiles: Grid, radii_px: Grid, half: float) -> Grid:
    """Return where profiles (n, r) fall through a level, nearest to 0; NaN where they do not."""
    bright = profiles >= half
    falls = bright[:, :-1] & ~bright[:, 1:]
    at = np.argmin(np.where(falls, np.abs(radii_px[:-1]), np.inf), axis=1)
    row = np.arange(len(profiles))
    high, low = profiles[row, at], profiles[row, at + 1]
    share = (high - half) / np.where(high > low, high - low, 1)
    return np.where(
        falls.any(axis=1), radii_px[at] + share * (radii_px[at + 1] - radii_px[at]), np.nan
    )


def wobble(shifts_px: Grid, radius_px: float) -> float:
    """Return the standard deviation of displacements in waves of at most `LONGEST_PX`.

    Args:
        shifts_px: (n,) at equal steps around a circle; where one is NaN, its neighbours count.
        radius_px: Of the circle.
    """
    finite = np.flatnonzero(np.isfinite(shifts_px))
    if not finite.size:
        return float("nan")
    whole = np.interp(np.arange(shifts_px.size), finite, shifts_px[finite], period=shifts_px.size)
    waves = np.fft.rfft(whole)
    waves[: int(np.ceil(2 * np.pi * radius_px / LONGEST_PX))] = 0
    return float(np.fft.irfft(waves, shifts_px.size).std())


def largest_rise(profiles: Grid) -> Grid:
    """Return how far profiles (..., r) rise at most, from any place to any later one; >= 0."""
    return np.asarray((profiles - np.minimum.accumulate(profiles, axis=-1)).max(axis=-1))


def _profiles(picture: FloatArray | Grid, limb: Limb, radii_px: Grid) -> Grid:
    """Return (colours, angles, radii) at distances from the limb, > 0 outside."""
    count = limb.radius_px.size
    angle = 2 * np.pi * np.arange(count)[:, None] / count
    radius = limb.radius_px[:, None] + radii_px
    y = limb.center_px[0] + np.sin(angle) * radius
    x = limb.center_px[1] + np.cos(angle) * radius
    planes = [p.astype(np.float64) for p in picture]
    return np.stack([scipy.ndimage.map_coordinates(p, [y, x], order=1) for p in planes])
