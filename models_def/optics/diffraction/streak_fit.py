"""Dense kernels as streak optics: a core, arms by profile and section, a coarse haze.

    dense kernels -> directions of the arms -> haze beside them -> profile x section of each arm

An arm is told from the haze under it by alternating least squares: the section that fits best along
a profile, then the profile along that section.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.shares import find_streaks
from camkit.streaks import (
    HAZE_STEP_PX,
    MAX_CORE_PX,
    SECTION_STEP_PX,
    StreakOptics,
    arm_axes,
    arm_light,
    haze_taps,
)

SECTION_PX: Final = 6.0
"""Half of the width in which an arm's light is told from haze."""
_ROUNDS: Final = 4
_REACH_SHARE: Final = 0.995
"""Of an arm's light; beyond, it is haze."""
_TAIL_PX: Final = 4
_ENDED: Final = 0.5
"""Of an arm's mean brightness; one that is brighter at the border of the kernels goes on there."""
_TINY: Final = 1e-12
FloatGrid = NDArray[np.float64]


class NoStreaksError(ContractError):
    """Kernels in which no arms are found, or whose arms do not end."""


def fit_streaks(
    kernels: NDArray[np.float32],
    bare: NDArray[np.float32],
    *,
    depths_mm: Sequence[float],
    wavelengths_um: Sequence[float],
    pitch_um: float,
    core_px: int = MAX_CORE_PX,
) -> StreakOptics:
    """Return the streak optics of dense kernels.

    Args:
        kernels: (depth, wavelength, n, n), n odd: light of a point, shares of what enters.
        bare: The same of the lens without its plate.
        depths_mm: Of the kernels.
        wavelengths_um: Of the kernels.
        pitch_um: Of their pixels.
        core_px: Side of the core, odd.

    Raises:
        NoStreaksError: If no arms are found, or they go on beyond the kernels.
    """
    angles = _arm_angles(kernels[0, kernels.shape[1] // 2], bare[0, kernels.shape[1] // 2])
    side, half = kernels.shape[-1], core_px // 2
    place = np.arange(side) - side // 2
    outside = np.maximum(np.abs(place)[:, None], np.abs(place)[None, :]) > half
    axes = [arm_axes(place, angle) for angle in angles]
    fits = [[_fit(k, axes, outside) for k in waves] for waves in kernels.astype(np.float64)]
    profiles = np.array([[fit[0] for fit in waves] for waves in fits])
    reach = _reach(profiles, half)
    inside = slice(side // 2 - half, side // 2 + half + 1)
    return StreakOptics(
        core=np.ascontiguousarray(kernels[..., inside, inside]),
        bare_core=np.ascontiguousarray(bare[..., inside, inside]),
        profiles=profiles[..., : reach + 1].astype(np.float32),
        sections=np.mean([[f[1] for f in waves] for waves in fits], axis=0).astype(np.float32),
        angles_rad=np.array(angles),
        haze=np.array([[fit[2] for fit in waves] for waves in fits], np.float32),
        depths_mm=np.array(depths_mm, np.float64),
        wavelengths_um=np.array(wavelengths_um, np.float64),
        pixel_pitch_um=pitch_um,
    )


def _arm_angles(kernel: NDArray[np.float32], bare: NDArray[np.float32]) -> list[float]:
    """Return the directions of both arms of every streak."""
    streaks = find_streaks(torch.from_numpy(kernel), torch.from_numpy(bare))
    if not streaks:
        raise NoStreaksError("no streaks were found in the kernels: they are not streak optics")
    lines = sorted(math.radians(streak.angle_deg) for streak in streaks)
    return [line + turn for turn in (0.0, math.pi) for line in lines]


def _fit(
    kernel: FloatGrid, axes: Sequence[tuple[FloatGrid, FloatGrid]], outside: NDArray[np.bool_]
) -> tuple[FloatGrid, FloatGrid, FloatGrid]:
    """Return profiles (arm, distance), sections (arm, offset) and haze (m, m) of one kernel."""
    near = [(al > 0) & (np.abs(ac) <= SECTION_PX) & outside for al, ac in axes]
    alone = [mine & (np.sum(near, axis=0) == 1) for mine in near]
    usable = outside & ~np.any(near, axis=0)
    if not usable.any():
        raise NoStreaksError(
            f"kernels of {kernel.shape[0]} px have no place beside core and arms: compute a wider "
            "window"
        )
    arms = np.zeros_like(kernel)
    for _ in range(_ROUNDS):
        haze = _haze(kernel - arms, usable)
        taps = haze_taps(kernel.shape[0], haze.shape[0]).astype(np.float64)
        added = kernel - taps @ haze @ taps.T
        arm_fits = [
            _separated(added[here], along[here], across[here], kernel.shape[0])
            for (along, across), here in zip(axes, alone, strict=True)
        ]
        arms = np.sum(
            [arm_light(*f, *axis) for f, axis in zip(arm_fits, axes, strict=True)], axis=0
        )
        usable = outside  # with the arms taken away, squares under them are known too
    profiles, sections = zip(*arm_fits, strict=True)
    return np.array(profiles), np.array(sections), haze


def _haze(kernel: FloatGrid, usable: NDArray[np.bool_]) -> FloatGrid:
    """Return the mean light of squares where no arm lies; others have that of their ring."""
    side = kernel.shape[0]
    squares = (side // HAZE_STEP_PX - 1) // 2 * 2 + 1
    place = np.arange(side) - side // 2
    index = np.clip(np.rint(place / HAZE_STEP_PX).astype(int) + squares // 2, 0, squares - 1)
    flat = (index[:, None] * squares + index[None, :])[usable]
    total = np.bincount(flat, kernel[usable], squares**2)
    count = np.bincount(flat, minlength=squares**2)
    haze = (total / np.maximum(count, 1)).reshape(squares, squares)
    filled_cells = (count > 0).reshape(squares, squares)
    middle = np.arange(squares) - squares // 2
    ring = np.rint(np.hypot(middle[:, None], middle[None, :])).astype(int)
    means = np.bincount(ring[filled_cells], haze[filled_cells], ring.max() + 1)
    counts = np.bincount(ring[filled_cells], minlength=ring.max() + 1)
    filled = np.interp(
        np.arange(ring.max() + 1),
        np.flatnonzero(counts),
        (means / np.maximum(counts, 1))[counts > 0],
    )
    return np.maximum(np.where(filled_cells, haze, filled[ring]), 0)


def _separated(
    light: FloatGrid, along: FloatGrid, across: FloatGrid, side: int
) -> tuple[FloatGrid, FloatGrid]:
    """Return the profile and the section whose product is nearest to an arm's light."""
    steps = round(SECTION_PX / SECTION_STEP_PX)
    distances, offsets = side // 2 + 1, 2 * steps + 1
    section = np.exp(-0.5 * (SECTION_STEP_PX * (np.arange(offsets) - steps)) ** 2)
    profile = np.zeros(distances)
    for _ in range(_ROUNDS):
        profile = _line(
            light,
            along,
            np.interp(across / SECTION_STEP_PX + steps, np.arange(offsets), section),
            distances,
        )
        section = _line(
            light,
            across / SECTION_STEP_PX + steps,
            np.interp(along, np.arange(distances), profile),
            offsets,
        )
        total = section.sum() * SECTION_STEP_PX
        section, profile = section / max(total, _TINY), profile * total
    return profile, section


def _line(light: FloatGrid, place: FloatGrid, weight: FloatGrid, count: int) -> FloatGrid:
    """Return the line, linear between integers, whose values times weights are nearest to light."""
    low = np.clip(np.floor(place).astype(int), 0, count - 2)
    share = np.clip(place - low, 0, 1)
    diagonal, off_diagonal, right_side = np.zeros(count), np.zeros(count - 1), np.zeros(count)
    for part, index in (((1 - share) * weight, low), (share * weight, low + 1)):
        diagonal += np.bincount(index, part**2, count)
        right_side += np.bincount(index, part * light, count)
    off_diagonal += np.bincount(low, (1 - share) * share * weight**2, count - 1)
    # what no light tells is drawn to its neighbours
    soft = 1e-3 * diagonal.max() + _TINY
    matrix = np.zeros((3, count))
    matrix[1] = diagonal + 2 * soft
    matrix[0, 1:] = matrix[2, :-1] = off_diagonal - soft
    matrix[1, 0] -= soft
    matrix[1, -1] -= soft
    return np.maximum(solve_banded((1, 1), matrix, right_side), 0)


def _reach(profiles: FloatGrid, half: int) -> int:
    """Return the distance within which nearly all light of the longest arms lies."""
    tails = profiles[..., half + 1 :]
    if (tails[..., -_TAIL_PX:].mean(axis=-1) > _ENDED * tails.mean(axis=-1)).any():
        raise NoStreaksError("the arms do not end within the kernels: compute a wider window")
    share = np.cumsum(tails, axis=-1) / np.maximum(tails.sum(axis=-1, keepdims=True), _TINY)
    return half + 1 + int((share < _REACH_SHARE).sum(axis=-1).max())
