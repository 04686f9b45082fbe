"""Depth of every pixel: rows of counts -> fit, hot pixels, neighbours where needed, two returns.

    counts -> every pixel alone -> hot pixels -> squares where one pixel is not enough
                                             `-> second return where the residual asks for one
           -> Sharpened: time, amplitude, background, sigma, evidence, what is believed

A hot pixel shows what lies around it and is never believed. A blind one (pile-up left nothing of
some of its bins) is fitted and not believed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.bank import make_bank
from camkit.runtime.kinds.spad.fit import Fit, Fitter
from camkit.runtime.kinds.spad.hot_pixels import NEIGHBOURHOOD_PX, check_map, find_hot, painted_over
from camkit.runtime.kinds.spad.least_squares import LeastSquares
from camkit.runtime.kinds.spad.pooling import FALSE_ALARMS, SIDES, Pool, Pooled, fit_pooled
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.second_return import SecondReturns
from camkit.runtime.kinds.spad.time_axis import TimeAxis

Method = Literal["log", "lsq"]
PER_PIXEL: Final = ("amplitude", "background", "intensity")
"""What is photons of a pixel."""
METHODS: Final[tuple[Method, ...]] = ("log", "lsq")


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """The way in which pixels are fitted.

    Attributes:
        method: log: the log-matched bank. lsq: least squares, as the dissertation does.
        pool: Side of the squares where one pixel is not enough.
        returns: How many surfaces a pixel may show, 1 or 2.
        false_alarms: Rate per pixel at which a return is believed that is none.
        seek_hot: Whether pixels are looked for that count without light.
    """

    method: Method = "log"
    pool: Pool = "auto"
    returns: int = 1
    false_alarms: float = FALSE_ALARMS
    seek_hot: bool = True

    @property
    def reach_px(self) -> int:
        """Return how far beyond a row others bear on it."""
        widest = max(SIDES[self.pool])
        return NEIGHBOURHOOD_PX // 2 + widest // 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Sharpened:
    """The fits of every pixel; all arrays (returns, h, w), the nearest surface first.

    Attributes:
        time_of_flight_ps: mu.
        amplitude: Signal photons.
        background: Counts of a bin.
        sigma_ps: Standard deviation that the time should have.
        evidence: Twice the log likelihood over background alone; of a second return over one.
        intensity: All photons of the pixel itself.
        valid: Whether the return is believed.
        pooled: Side of the square whose photons were fitted; 0 where none was enough.
        hot: Whether the pixel counts without light.
    """

    time_of_flight_ps: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    background: NDArray[np.float64]
    sigma_ps: NDArray[np.float64]
    evidence: NDArray[np.float64]
    intensity: NDArray[np.float64]
    valid: NDArray[np.bool_]
    pooled: NDArray[np.int64]
    hot: NDArray[np.bool_]


def times_photons(sharpened: Sharpened, factor: NDArray[np.float64]) -> Sharpened:
    """Return it with more photons, (h, w) times as many."""
    changed: dict[str, Any] = {name: getattr(sharpened, name) * factor for name in PER_PIXEL}
    return replace(sharpened, **changed)


def stacked(strips: Sequence[Sharpened]) -> Sharpened:
    """Return strips, from top to bottom, as one."""
    names = [field.name for field in fields(Sharpened)]
    return Sharpened(
        **{name: np.concatenate([getattr(s, name) for s in strips], axis=1) for name in names}
    )


class Sharpener:
    """A pulse on an axis with what fits need of it; serves any number of strips.

    Attributes:
        fitter: The bank.
        way: How pixels are fitted.
    """

    def __init__(self, axis: TimeAxis, pulse: Pulse, way: Way) -> None:
        """Compute the bank.

        Raises:
            ContractError: If it would take too many templates.
        """
        self.fitter = Fitter(make_bank(axis, pulse))
        self.way = way
        self._second = SecondReturns(self.fitter)
        is_log = way.method == "log"
        self._fit: Callable[[FloatArray], Fit] = (
            self.fitter.fit if is_log else LeastSquares(self.fitter).fit
        )

    def strip(
        self,
        cube: FloatArray,
        *,
        hot: NDArray[np.bool_] | None = None,
        blind: NDArray[np.bool_] | None = None,
        core: slice | None = None,
        growth: NDArray[np.float64] | None = None,
    ) -> Sharpened:
        """Fit the pixels of some rows.

        Args:
            cube: (h, w, bins) counts, with `Way.reach_px` more rows where the array goes on.
            hot: (h, w) pixels that are known to be hot; others are found.
            blind: (h, w) pixels that pile-up left no counts in some bins.
            core: Rows that are asked for; None for all.
            growth: (h, w) variance over mean of the counts, where pile-up was taken out of them.

        Returns:
            Of the core rows.

        Raises:
            ContractError: If more than half of the pixels are hot.
        """
        if growth is not None:
            check_wish()
            even = np.divide(cube, growth[:, :, None], dtype=np.float32)
            fitted = self.strip(even, hot=hot, blind=blind, core=core)
            # what was painted over is of the pixels around
            return times_photons(fitted, _painted(growth[core or slice(None)], fitted.hot[0]))
        shape, bins = cube.shape[:2], cube.shape[2]
        alone = self._fit(cube.reshape(-1, bins))
        check_wish()
        photons = cube.sum(axis=2, dtype=np.float64)
        is_hot = np.zeros(shape, dtype=bool)
        if self.way.seek_hot:
            is_hot = find_hot(alone.background.reshape(shape), cube, photons)
        if hot is not None:
            is_hot |= hot
        if core is None:
            check_map(is_hot)
        doubtful = is_hot if blind is None else is_hot | blind
        pooled = fit_pooled(
            self.fitter,
            cube,
            fit=self._fit,
            alone=alone,
            pool=self.way.pool,
            false_alarms=self.way.false_alarms,
            sound=~doubtful,
            core=core,
        )
        arrays = self._arrays(pooled, photons, doubtful, is_hot)
        if self.way.returns == 2:
            arrays = self._second.added(arrays, pooled, cube, ~doubtful, self.way.false_alarms)
        if is_hot[core or slice(None)].any():
            painted = _painted(cube, is_hot)
            self._store(arrays, self._fit(painted[is_hot]), is_hot)
            arrays["intensity"][:, is_hot] = painted[is_hot].sum(axis=1, dtype=np.float64)
        return Sharpened(**{name: a[:, core or slice(None)] for name, a in arrays.items()})

    def _arrays(
        self,
        pooled: Pooled,
        photons: NDArray[np.float64],
        doubtful: NDArray[np.bool_],
        hot: NDArray[np.bool_],
    ) -> dict[str, NDArray[Any]]:
        """Return the arrays of `Sharpened` for one return, (1, h, w) each."""
        shape = photons.shape
        valid = pooled.valid.reshape(shape) & ~doubtful
        of_fit = {name: getattr(pooled.fit, name).reshape(1, *shape) for name in FITTED}
        return {
            **of_fit,
            "intensity": photons[None],
            "valid": valid[None],
            "pooled": np.where(valid, pooled.side.reshape(shape), 0)[None],
            "hot": hot[None],
        }

    @staticmethod
    def _store(arrays: dict[str, NDArray[Any]], fit: Fit, where: NDArray[np.bool_]) -> None:
        for name in FITTED:
            arrays[name] = arrays[name].copy()
            layers = slice(None) if name in OF_BOTH else slice(1)
            arrays[name][layers, where] = getattr(fit, name)


def _painted(values: NDArray[Any], hot: NDArray[np.bool_]) -> NDArray[Any]:
    """Return them with hot pixels painted over, where any pixel is sound."""
    return painted_over(values, hot) if hot.any() and not hot.all() else values


FITTED: Final = ("time_of_flight_ps", "amplitude", "background", "sigma_ps", "evidence")
OF_BOTH: Final = ("time_of_flight_ps", "background", "sigma_ps")
"""What a second return that is none has of the first."""
