"""The test whether pixels lie inside the surface of their square of neighbours, or beside it.

Beside an edge every square holds a return, and the chance that a pixel's own few photons happen to
agree with it is large. A pixel is inside where its own photons agree, and where every block of its
square that holds the pixel proves the return: 2x2 pixels of a square of 3, 3x3 of one of 5. An
empty place, also in a corner, is made of empty blocks, and background alone passes one of them at
the stated rate. A pixel that is not inside proves the return by its own photons.

    +-------+        +-------+
    | # # . |        | . # # |        and the two below: each of the four must prove the return
    | # o . |        | . o # |
    | . . . |        | . . . |
    +-------+        +-------+

Blocks are their own judges: the background of a pixel next to a surface may differ from that of the
surface (its light, or what pile-up left of it), so without a return a block has the mean of its own
counts, and with one the background of the square or what its own counts leave, whichever is
likelier. Places that are narrower than a block are filled by what lies around them.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from camkit.arrays import FloatArray
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.bank import Bank
from camkit.runtime.kinds.spad.fit import Fit

LEAST_BACKGROUND: Final = 1e-3
"""Counts of a bin; no detector is darker for certain."""
AT_ONCE_BYTES: Final = 48_000_000
"""Counts of squares that are looked at at once."""


def least_gain(rate: float) -> float:
    """Return the gain at a given place and size that background alone exceeds at most at a rate.

    A log likelihood ratio between two normal distributions d standard deviations apart is normal,
    -d^2 / 2 on average, with a standard deviation of d: it exceeds g with the chance
    Q(g / d + d / 2), which is largest where d^2 = 2 g, Q(sqrt(2 g)).

    Args:
        rate: Of false alarms, in 0..0.5, both left out.
    """
    return float(ndtri(rate) ** 2 / 2)


def are_believed(
    bank: Bank,
    cube: FloatArray,
    sound: NDArray[np.bool_] | None,
    rows: NDArray[np.int64],
    fit: Fit,
    side: int,
    rate: float,
) -> NDArray[np.bool_]:
    """Return which pixels may take what their squares found.

    Args:
        bank: The templates.
        cube: (h, w, bins) counts.
        sound: (h, w) pixels that count; None for all.
        rows: (p,) flat numbers of the pixels.
        fit: What their squares found, amplitude and background of one pixel.
        side: Of the squares.
        rate: Of false alarms.
    """
    # two ways to be believed share the rate
    least, is_believed = least_gain(rate / 2), np.zeros(len(rows), dtype=bool)
    at_once = max(1, AT_ONCE_BYTES // (16 * side * side * bank.bins.shape[1]))
    everywhere = np.ones(cube.shape[:2], bool) if sound is None else sound
    photons = cube.sum(axis=2)
    for start in range(0, len(rows), at_once):
        part = slice(start, start + at_once)
        pulses = _Pulses(
            bank=bank,
            template=fit.template[part],
            amplitude=fit.amplitude[part],
            background=fit.background[part],
        )
        patches = _patches(pulses, (cube, photons, everywhere), rows[part], side)
        places = np.divmod(rows[part], cube.shape[1])
        alone = pulses.gains(
            patches, slice(side // 2, side // 2 + 1), slice(side // 2, side // 2 + 1)
        )
        lowest = _lowest_gains(pulses, patches, places, cube.shape[:2], side)
        is_believed[part] = ((alone > 0) & (lowest > least)) | (alone > least)
    return is_believed


@dataclass(frozen=True, slots=True, kw_only=True)
class _Patches:
    """Squares of pixels; what lies beyond the border, or is not sound, holds nothing.

    Attributes:
        near: (p, side, side, b) counts in the bins of the pulse.
        photons: (p, side, side) of all bins.
        members: (p, side, side) 1 where a pixel counts.
    """

    near: FloatArray
    photons: FloatArray
    members: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class _Pulses:
    """The pulses that squares found, of one pixel each; arrays (p,)."""

    bank: Bank
    template: NDArray[np.int64]
    amplitude: NDArray[np.float64]
    background: NDArray[np.float64]

    def gains(self, patches: _Patches, down: slice, across: slice) -> NDArray[np.float64]:
        """Return how much a part of every square speaks for the pulse, (p,), see the module."""
        near = patches.near[:, down, across].sum(axis=(1, 2), dtype=np.float64)
        photons = patches.photons[:, down, across].sum(axis=(1, 2), dtype=np.float64)
        members = patches.members[:, down, across].sum(axis=(1, 2), dtype=np.float64)
        bins, counted = self.bank.axis.bins, np.maximum(members, 1.0)
        pulse = self.amplitude[:, None] * self.bank.shares[self.template]
        visible = self.amplitude * self.bank.totals[self.template]
        even = np.maximum(photons / (counted * bins), LEAST_BACKGROUND)
        rest = photons / (counted * bins) - visible / bins
        gains = []
        for background in (self.background, rest):
            dark = np.maximum(background, LEAST_BACKGROUND)
            of_bins = (near * np.log1p(pulse / dark[:, None])).sum(axis=1)
            of_all = photons * np.log(dark / even) - members * (visible + bins * (dark - even))
            gains.append(of_bins + of_all)
        return np.asarray(np.maximum(*gains))


def _patches(
    pulses: _Pulses,
    scene: tuple[FloatArray, FloatArray, NDArray[np.bool_]],
    rows: NDArray[np.int64],
    side: int,
) -> _Patches:
    """Cut the squares of pixels out of counts (h, w, bins), photons and sound pixels (h, w)."""
    cube, all_photons, sound = scene
    (height, width, _), reach = cube.shape, side // 2
    bins = pulses.bank.bins[pulses.template]
    y, x = np.divmod(rows, width)
    shape = (len(rows), side, side)
    near = np.zeros((*shape, bins.shape[1]), np.float32)
    photons, members = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for dy in range(side):
        check_wish()
        for dx in range(side):
            at_y, at_x = y + dy - reach, x + dx - reach
            there = (at_y >= 0) & (at_y < height) & (at_x >= 0) & (at_x < width)
            there[there] = sound[at_y[there], at_x[there]]
            at_y, at_x = at_y[there], at_x[there]
            near[there, dy, dx] = cube[at_y[:, None], at_x[:, None], bins[there]]
            photons[there, dy, dx] = all_photons[at_y, at_x]
            members[there, dy, dx] = 1
    return _Patches(near=near, photons=photons, members=members)


def _lowest_gains(
    pulses: _Pulses,
    patches: _Patches,
    places: tuple[NDArray[np.int64], NDArray[np.int64]],
    shape: tuple[int, int],
    side: int,
) -> NDArray[np.float64]:
    """Return the least gain of all blocks that hold a pixel and lie in the array, (p,)."""
    block, reach = (side + 1) // 2, side // 2
    lowest = np.full(len(pulses.template), np.inf)
    for top in range(block):
        check_wish()
        for left in range(block):
            first_y, first_x = places[0] - reach + top, places[1] - reach + left
            is_inside = (first_y >= 0) & (first_y + block <= shape[0])
            is_inside &= (first_x >= 0) & (first_x + block <= shape[1])
            gains = pulses.gains(patches, slice(top, top + block), slice(left, left + block))
            lowest = np.where(is_inside, np.minimum(lowest, gains), lowest)
    return np.where(np.isinf(lowest), -np.inf, lowest)
