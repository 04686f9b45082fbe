"""Break point of a method: the break rule, the point between two values, its confidence.

A method is broken at a value where, in the mean over the scenes, it is worse than a rival (the
input, the bank alone) by more than a tie, or its chi^2 per pixel exceeds the limit; or where a
scenario found a fault on any scene (NaN, a seam, invented contrast). From the nominal value
outwards, the break point is where the first of these crosses, linear between the last sound and
the first broken value (over the logarithm where the scenario says so). A fault has no margin to
interpolate: its value is the break point. The confidence is a bootstrap over the scenes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from camkit.report.stress.consistency import LIMIT

TIE_DB: Final = 0.05
CHI2: Final = "chi2"
"""Name of the rule of data consistency."""
RESAMPLES: Final = 1000
BOOTSTRAP_SEED: Final = 5
CONFIDENCE: Final = (0.025, 0.975)

Grid = NDArray[np.float64]
Side = Literal["down", "up"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """Distance of one method from breaking, per value and scene; NaN where it is not known.

    Attributes:
        values: (n,) increasing.
        nominal: Index of the undisturbed value.
        gains: Rule -> (n, scenes); a method is sound while the mean over the scenes is >= 0.
        faults: (n, scenes) bool.
        log: Interpolate over the logarithm of the values.
        ordered: Values between two values mean something.
    """

    values: Grid
    nominal: int
    gains: dict[str, Grid]
    faults: NDArray[np.bool_]
    log: bool = False
    ordered: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Break:
    """Break of a method on one side of the nominal value.

    Attributes:
        method: Name.
        side: Below (down) or above (up) the nominal value.
        point: The break point; None if it does not break within the range.
        reason: Which rule; empty if none.
        ci: 95 % confidence of the point; None at an end beyond the range.
    """

    method: str
    side: Side
    point: float | None
    reason: str = ""
    ci: tuple[float | None, float | None] = (None, None)


def margins_of(
    psnr_db: dict[str, Grid], chi2: Grid, *, method: str, rivals: Sequence[str]
) -> dict[str, Grid]:
    """Convert measurements to margins.

    Args:
        psnr_db: Method -> (n, scenes).
        chi2: (n, scenes) of the method.
        method: The one that is judged.
        rivals: Whom it must not fall behind.
    """
    gains = {f"below {r}": psnr_db[method] - psnr_db[r] + TIE_DB for r in rivals if r != method}
    return gains | {CHI2: LIMIT - chi2}


def find_break(margins: Margins, method: str, side: Side) -> Break:
    """Find the break point on one side, with its confidence."""
    scenes = margins.faults.shape[1]
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    draws = rng.multinomial(scenes, np.full(scenes, 1 / scenes), size=RESAMPLES)
    points, rules = _breaks(margins, side, np.ones((1, scenes)))
    resampled, _ = _breaks(margins, side, draws.astype(np.float64))
    low, high = np.quantile(resampled, CONFIDENCE, method="inverted_cdf")
    point = _finite(float(points[0]))
    return Break(
        method=method,
        side=side,
        point=point,
        reason="" if point is None else rules[0],
        ci=(_finite(float(low)), _finite(float(high))),
    )


def sound_values(margins: Margins) -> NDArray[np.bool_]:
    """Return for each value whether the method is sound there and on the way from the nominal."""
    means = _means(margins, np.ones((1, margins.faults.shape[1])))
    sound = np.asarray(np.min(list(means.values()), axis=0)[:, 0] >= 0)
    connected = np.zeros(sound.shape, dtype=bool)
    for way in (range(margins.nominal, sound.size), range(margins.nominal, -1, -1)):
        for i in way:
            if not sound[i]:
                break
            connected[i] = True
    return connected


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _means(margins: Margins, weights: Grid) -> dict[str, Grid]:
    """Return rule -> (n, draws) mean margin; what no scene knows is no reason to break.

    Args:
        margins: Per value and scene.
        weights: (draws, scenes), how often each scene was drawn.
    """
    means = {}
    for rule, gain in margins.gains.items():
        finite = np.isfinite(gain)
        count = finite @ weights.T
        total = np.where(finite, gain, 0) @ weights.T
        means[rule] = np.where(count > 0, total / np.maximum(count, 1), np.inf)
    means["fault"] = np.where(margins.faults @ weights.T > 0, -np.inf, np.inf)
    return means


def _breaks(margins: Margins, side: Side, weights: Grid) -> tuple[Grid, list[str]]:
    """Return the break point of every draw, infinite where there is none, and its rule."""
    means = _means(margins, weights)
    rules, stacked = list(means), np.stack(list(means.values()))
    count, nominal = margins.values.size, margins.nominal
    way = np.arange(nominal, count) if side == "up" else np.arange(nominal, -1, -1)
    broken: NDArray[np.bool_] = (stacked.min(axis=0) < 0)[way]
    first = broken.argmax(axis=0)
    here, previous = way[first], way[np.maximum(first - 1, 0)]
    draws = np.arange(weights.shape[0])
    shares = _crossings(stacked[:, previous, draws], stacked[:, here, draws])
    rule = np.where(first > 0, shares.argmin(axis=0), stacked[:, here, draws].argmin(axis=0))
    share = np.where(first > 0, shares.min(axis=0), 1.0)
    points = _interpolate(margins, margins.values[previous], margins.values[here], share)
    no_break = np.inf if side == "up" else -np.inf
    return np.where(broken.any(axis=0), points, no_break), [rules[r] for r in rule]


def _crossings(sound: Grid, broken: Grid) -> Grid:
    """Return the share of the way at which margins cross zero.

    A fault crosses at its end; a rule that is not broken crosses nowhere.
    """
    both = np.isfinite(sound) & np.isfinite(broken) & (sound >= 0) & (broken < 0)
    above, below = np.where(both, sound, 1.0), np.where(both, broken, -1.0)
    share = np.where(both, above / (above - below), 1.0)
    return np.where(broken < 0, share, np.inf)


def _interpolate(margins: Margins, sound: Grid, broken: Grid, share: Grid) -> Grid:
    if not margins.ordered:
        return broken
    linear = sound + (broken - sound) * share
    if not margins.log:
        return linear
    positive = (sound > 0) & (broken > 0)
    a, b = (np.where(positive, v, 1.0) for v in (sound, broken))
    return np.where(positive, a * (b / a) ** share, linear)
