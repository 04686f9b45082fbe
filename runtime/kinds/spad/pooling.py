"""Photons shared with neighbours, only where a pixel alone has too few.

    counts -> fit -> believed?  yes: done
                  `-> squares of 3, then of 5 pixels, each fitted anew, and

a pixel takes what its square found only if its own photons speak for it, and either all small
blocks around it prove it too, or its own do (`camkit.runtime.kinds.spad.surroundings`). Otherwise
surfaces would grow over their edges, for beside them every square holds a return.

Who chooses a side wants every pixel to share: there it is enough that its own photons do not refute
the square at a level of one in twenty, neither by their silence nor by speaking so much more for
another time, the search for it counted. Photons speak by their gain: with the pulse that each pixel
of the square would have on average, a s_k, over its background b, the sum of log(1 + a s_k / b)
less a S.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.evidence import threshold_for
from camkit.runtime.kinds.spad.fit import Fit, Fitter
from camkit.runtime.kinds.spad.surroundings import LEAST_BACKGROUND, are_believed

Pool = Literal["auto", "1", "3", "5"]
SIDES: Final[dict[str, tuple[int, ...]]] = {
    "auto": (1, 3, 5),
    "1": (1,),
    "3": (3,),
    "5": (5,),
}
FALSE_ALARMS: Final = 1e-3
"""Pixels without any return that are believed to have one, unless a caller says otherwise."""
SPARSE: Final = 0.1
"""Of all pixels: squares of fewer are summed one by one."""
REFUTED: Final = 0.05
"""Chance at which a pixel's own photons refute the square that was chosen for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pooled:
    """The fits of every pixel, of the smallest square that sufficed.

    Attributes:
        fit: All arrays (h w,); amplitude and background are those of one pixel.
        valid: (h w,) whether a return is believed.
        side: (h w,) of the square; 0 where none sufficed.
    """

    fit: Fit
    valid: NDArray[np.bool_]
    side: NDArray[np.int64]


def fit_pooled(
    fitter: Fitter,
    cube: FloatArray,
    *,
    fit: Callable[[FloatArray], Fit] | None = None,
    alone: Fit | None = None,
    pool: Pool = "auto",
    false_alarms: float = FALSE_ALARMS,
    sound: NDArray[np.bool_] | None = None,
    core: slice | None = None,
) -> Pooled:
    """Fit one return to every pixel, by as few of its neighbours as it needs.

    Args:
        fitter: The bank.
        cube: (h, w, bins) float32 counts, finite and >= 0.
        fit: Counts (p, bins) -> what is found; None for the `fit` of the fitter.
        alone: What `fit` found of every pixel, where that is known.
        pool: Side of the squares; auto tries 1, 3 and 5.
        false_alarms: Rate per pixel, shared among the sides that are tried.
        sound: (h, w) pixels whose photons count in squares; None for all.
        core: Rows that are asked for; the others only lend their photons. None for all.

    Raises:
        ContractError: If pool or rate is none.
    """
    if pool not in SIDES:
        raise ContractError(f"pool must be one of {', '.join(SIDES)}; got {pool!r}")
    if not 0 < false_alarms < 0.5:
        raise ContractError(f"a rate of false alarms must lie in 0..0.5; got {false_alarms}")
    fit = fit or fitter.fit
    sides = SIDES[pool]
    threshold = threshold_for(false_alarms / len(sides), fitter.search_length)
    height, width, bins = cube.shape
    counts = cube.reshape(-1, bins)
    best = alone
    side_of = np.zeros(height * width, dtype=np.int64)
    is_core = np.zeros((height, width), dtype=bool)
    is_core[core or slice(None)] = True
    for side in sides:
        rows = np.flatnonzero(is_core.ravel() & (side_of == 0))
        if not len(rows):
            break
        if side == 1:
            new = fit(counts[rows]) if alone is None else fit_of_rows(alone, rows)
        else:
            square = Squares(cube, side, sound)
            new = _per_pixel(fit(square.counts(rows)), square.members[rows])
        good = new.evidence > threshold
        if side > 1 and pool == "auto":
            near = np.flatnonzero(good)
            good[near] = are_believed(
                bank=fitter.bank,
                cube=cube,
                sound=sound,
                rows=rows[near],
                fit=fit_of_rows(new, near),
                side=side,
                rate=false_alarms / len(sides),
            )
        elif side > 1:
            single = fit(counts[rows]) if alone is None else fit_of_rows(alone, rows)
            good &= ~_refute(fitter, counts[rows], new, single)
        best = (
            new if len(rows) == len(counts) else _merged(best or _nothing(len(counts)), new, rows)
        )
        side_of[rows[good]] = side
    return Pooled(fit=best or _nothing(len(counts)), valid=side_of > 0, side=side_of)


class Squares:
    """Sums over the square around each pixel; nothing lies beyond the border.

    Attributes:
        members: (h w,) how many sound pixels each square has, at least 1.
    """

    def __init__(self, cube: FloatArray, side: int, sound: NDArray[np.bool_] | None = None) -> None:
        """Sum the counts of squares.

        Args:
            cube: (h, w, bins) counts.
            side: Of the squares, odd.
            sound: (h, w) pixels that count; None for all.
        """
        height, width, _ = cube.shape
        self._cube, self._side = cube, side
        self._sound = np.ones((height, width), bool) if sound is None else sound
        inside = self._square_sums(self._sound[..., None].astype(np.float32)).reshape(-1)
        self.members = np.maximum(inside.astype(np.float64), 1.0)

    def counts(self, rows: NDArray[np.int64]) -> FloatArray:
        """Return the counts (p, bins) of the squares around pixels of these flat numbers."""
        height, width, bins = self._cube.shape
        if len(rows) > SPARSE * height * width:
            sound = np.where(self._sound[..., None], self._cube, np.float32(0))
            return self._square_sums(sound).reshape(-1, bins)[rows]
        reach = self._side // 2
        y, x = np.divmod(rows, width)
        sums = np.zeros((len(rows), bins), np.float32)
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                check_wish()
                at = (y + dy, x + dx)
                there = (at[0] >= 0) & (at[0] < height) & (at[1] >= 0) & (at[1] < width)
                there[there] = self._sound[at[0][there], at[1][there]]
                sums[there] += self._cube[at[0][there], at[1][there]]
        return sums

    def _square_sums(self, values: FloatArray) -> FloatArray:
        """Return the sums of every square, (h, w, n); whole numbers of photons stay exact."""
        reach = self._side // 2
        sums = values
        for axis in (0, 1):
            sums = sum(
                (_shifted(sums, step, axis) for step in range(1, reach + 1)), start=sums.copy()
            )
        return sums


def _shifted(values: FloatArray, step: int, axis: int) -> FloatArray:
    """Return what lies so many places before and after along an axis, together."""
    sums = np.zeros_like(values)
    check_wish()
    if step < values.shape[axis]:
        later = [slice(None)] * 3
        earlier = [slice(None)] * 3
        later[axis], earlier[axis] = slice(step, None), slice(None, -step)
        sums[tuple(earlier)] += values[tuple(later)]
        sums[tuple(later)] += values[tuple(earlier)]
    return sums


def _per_pixel(fit: Fit, members: NDArray[np.float64]) -> Fit:
    return replace(fit, amplitude=fit.amplitude / members, background=fit.background / members)


def _gain(
    fitter: Fitter, counts: FloatArray, fit: Fit, template: NDArray[np.int64] | None = None
) -> NDArray[np.float64]:
    """Return how much pixels' own photons speak for the pulse of their square."""
    bank = fitter.bank
    at = fit.template if template is None else template
    background = np.maximum(fit.background, LEAST_BACKGROUND)
    logs = np.log1p(fit.amplitude[:, None] * bank.shares[at] / background[:, None])
    gained = (np.take_along_axis(counts, bank.bins[at], axis=1) * logs).sum(axis=1)
    return np.asarray(gained - fit.amplitude * bank.totals[at])


def _refute(fitter: Fitter, counts: FloatArray, fit: Fit, single: Fit) -> NDArray[np.bool_]:
    """Return which pixels' own photons refute the pulse that their square found.

    Args:
        fitter: The bank.
        counts: (p, bins) counts of the pixels alone.
        fit: What the squares found.
        single: What the pixels found alone.
    """
    gained = _gain(fitter, counts, fit)
    elsewhere = _gain(fitter, counts, fit, single.template)
    near = fitter.bank.near
    here, there = near[fit.template], near[single.template]
    is_apart = (there[:, 0] >= here[:, 1]) | (here[:, 0] >= there[:, 1])
    is_silent = gained < np.log(REFUTED)
    surplus = threshold_for(REFUTED, fitter.search_length) / 2
    return np.asarray(is_silent | (is_apart & (elsewhere - gained > surplus)))


def fit_of_rows(fit: Fit, rows: NDArray[np.int64]) -> Fit:
    """Return what was found of some pixels."""
    return Fit(**{field.name: getattr(fit, field.name)[rows] for field in fields(Fit)})


def _nothing(count: int) -> Fit:
    arrays: dict[str, NDArray[Any]] = {field.name: np.zeros(count) for field in fields(Fit)}
    arrays["template"] = np.zeros(count, dtype=np.int64)
    return Fit(**arrays)


def _merged(old: Fit, new: Fit, rows: NDArray[np.int64]) -> Fit:
    """Return the old fit with new ones in some rows."""
    whole = {}
    for field in fields(Fit):
        values = getattr(old, field.name).copy()
        values[rows] = getattr(new, field.name)
        whole[field.name] = values
    return Fit(**whole)
