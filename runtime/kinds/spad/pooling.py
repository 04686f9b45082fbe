"""Photons shared with neighbours, only where a pixel alone has too few.

    counts -> fit -> believed?  yes: done
                  `-> squares of 3, then of 5 pixels, each fitted anew, and

a pixel takes what its square found only if its own photons speak for it: with the pulse that each
pixel of the square would have on average, a s_k, over its background b, the sum over its photons of
log(1 + a s_k / b) must exceed a S. Otherwise surfaces would grow over their edges.
"""

from dataclasses import dataclass, fields, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.evidence import threshold_for
from camkit.runtime.kinds.spad.fit import Fit, Fitter

Pool = Literal["auto", "1", "3", "5"]
SIDES: Final[dict[str, tuple[int, ...]]] = {
    "auto": (1, 3, 5),
    "1": (1,),
    "3": (3,),
    "5": (5,),
}
LEAST_BACKGROUND: Final = 1e-3
"""Counts of a bin; no detector is darker for certain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pooled:
    """What was found of every pixel, of the smallest square that sufficed.

    Attributes:
        fit: All arrays (h w,); amplitude and background are those of one pixel.
        valid: (h w,) whether a return is believed.
        side: (h w,) of the square; 0 where none sufficed.
    """

    fit: Fit
    valid: NDArray[np.bool_]
    side: NDArray[np.int64]


def fit_pooled(
    fitter: Fitter, cube: FloatArray, *, pool: Pool = "auto", false_alarms: float = 1e-3
) -> Pooled:
    """Fit one return to every pixel, by as few of its neighbours as it needs.

    Args:
        fitter: The bank.
        cube: (h, w, bins) float32 counts, finite and >= 0.
        pool: Side of the squares; auto tries 1, 3 and 5.
        false_alarms: Rate per pixel, shared among the sides that are tried.

    Raises:
        ContractError: If pool or rate is none.
    """
    if pool not in SIDES:
        raise ContractError(f"pool must be one of {', '.join(SIDES)}; got {pool!r}")
    if not 0 < false_alarms < 0.5:
        raise ContractError(f"a rate of false alarms must lie in 0..0.5; got {false_alarms}")
    sides = SIDES[pool]
    threshold = threshold_for(false_alarms / len(sides), fitter.search_length)
    height, width, bins = cube.shape
    alone = cube.reshape(-1, bins)
    found: Fit | None = None
    side_of = np.zeros(height * width, dtype=np.int64)
    for side in sides:
        rows = np.flatnonzero(side_of == 0)
        if not len(rows):
            break
        members = _members(height, width, side)[rows]
        counts = alone[rows] if side == 1 else _summed(cube, side).reshape(-1, bins)[rows]
        new = _per_pixel(fitter.fit(counts), members)
        good = new.evidence > threshold
        if side > 1:
            good &= _speak_for(fitter, alone[rows], new)
        found = new if found is None else _merged(found, new, rows)
        side_of[rows[good]] = side
    if found is None:  # no pixel at all
        found = fitter.fit(alone)
    return Pooled(fit=found, valid=side_of > 0, side=side_of)


def _members(height: int, width: int, side: int) -> NDArray[np.float64]:
    """Give how many pixels the square of each pixel has on the array."""
    reach = side // 2
    rows = np.minimum(np.arange(height), reach) + np.minimum(np.arange(height)[::-1], reach) + 1
    columns = np.minimum(np.arange(width), reach) + np.minimum(np.arange(width)[::-1], reach) + 1
    return np.asarray(np.multiply.outer(rows, columns).ravel(), dtype=np.float64)


def _summed(cube: FloatArray, side: int) -> FloatArray:
    """Give the sums over squares; nothing lies beyond the border."""
    mean = uniform_filter(cube.astype(np.float64), size=(side, side, 1), mode="constant", cval=0.0)
    return np.asarray(np.maximum(mean * side * side, 0.0), dtype=np.float32)


def _per_pixel(fit: Fit, members: NDArray[np.float64]) -> Fit:
    return replace(fit, amplitude=fit.amplitude / members, background=fit.background / members)


def _speak_for(fitter: Fitter, own: FloatArray, fit: Fit) -> NDArray[np.bool_]:
    """Tell which pixels' own photons speak for the pulse that their square found."""
    bank = fitter.bank
    bins, shares = bank.bins[fit.template], bank.shares[fit.template]
    background = np.maximum(fit.background, LEAST_BACKGROUND)
    logs = np.log1p(fit.amplitude[:, None] * shares / background[:, None])
    gained = (np.take_along_axis(own, bins, axis=1) * logs).sum(axis=1)
    return np.asarray(gained > fit.amplitude * bank.totals[fit.template])


def _merged(old: Fit, new: Fit, rows: NDArray[np.int64]) -> Fit:
    """Give the old fit with new ones in some rows."""
    whole = {}
    for field in fields(Fit):
        values = getattr(old, field.name).copy()
        values[rows] = getattr(new, field.name)
        whole[field.name] = values
    return Fit(**whole)
