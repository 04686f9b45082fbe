"""The fading of streaks along their arms: one curve for all lights of a picture.

amounts of all runs and colours -> steps that any fading would make -> the fading that fits best

The curve is held at a few distances, falls with distance and is never negative; it is sought with
the penalty by which the amounts were found.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.deglare.arms import Amounts, Columns, Labels

KNOTS: Final = 8
SCALE: Final = 0.05
ROUNDS: Final = 4
_STEADY: Final = 1e-6
Curve = NDArray[np.float64]


def first_fading(rows: int, reach_rows: float) -> FloatArray:
    """Return the fading to start from, (row,): a straight line that ends where arms do."""
    return np.clip(1 - np.arange(rows) / reach_rows, 0, None).astype(np.float32)


def fitted_fading(
    colours: Sequence[Columns],
    runs: Labels,
    amounts: Sequence[Amounts],
    fading: FloatArray,
    reach_rows: float,
) -> FloatArray | None:
    """Fit the fading to the amounts of all colours.

    Args:
        colours: Columns of every colour.
        runs: (row, column) of the lights in them.
        amounts: (column, run) of every colour.
        fading: (row,) from which they were found.
        reach_rows: Where arms end.

    Returns:
        (row,) float32, for the same amounts; None where nothing is thrown near the lights.
    """
    rows = fading.size
    knots = np.concatenate([[0.0], np.geomspace(2.0, max(reach_rows, 3.0), KNOTS - 1)])
    place = np.arange(rows)
    hats = np.stack([np.interp(place, knots, unit, right=0) for unit in np.eye(KNOTS)])
    parts = [_steps(c, runs, a, hats) for c, a in zip(colours, amounts, strict=True)]
    hat_steps = np.concatenate([part[0] for part in parts])
    light_steps = np.concatenate([part[1] for part in parts])
    level = np.concatenate([part[2] for part in parts])
    curve = _falling(hat_steps, light_steps, SCALE * level, np.interp(knots, place, fading))
    if not curve[0] > 0:
        return None
    return np.asarray(np.interp(place, knots, curve, right=0), np.float32)


def _steps(
    columns: Columns, runs: Labels, amounts: Amounts, hats: Curve
) -> tuple[Curve, Curve, Curve]:
    """Return the steps across columns of every hat, those seen, and the level, where usable."""
    usable = columns.usable[1:] & columns.usable[:-1] & columns.joined[:, None]
    source = np.zeros(columns.light.shape, np.float32)
    for run in range(amounts.shape[1]):
        source += np.where(run + 1 == runs.T, amounts[:, run, None], 0).astype(np.float32)
    place = np.arange(hats.shape[1])
    distance = np.abs(place[:, None] - place[None, :])
    hat_steps = [np.diff(source @ hat[distance].astype(np.float32), axis=0)[usable] for hat in hats]
    level = (columns.level[1:] + columns.level[:-1])[usable] / 2
    light_steps = np.diff(columns.light, axis=0)[usable]
    return np.stack(hat_steps, axis=1).astype(np.float64), light_steps.astype(np.float64), level


def _falling(hat_steps: Curve, light_steps: Curve, scale: Curve, first: Curve) -> Curve:
    """Return the falling curve, >= 0, whose steps fit those seen."""
    summed = np.triu(np.ones((KNOTS, KNOTS)))  # a curve of its falls
    hat_steps = hat_steps @ summed
    falls = np.linalg.solve(summed, first)
    for _ in range(ROUNDS):
        weight = 1 / (scale**2 * (1 + ((light_steps - hat_steps @ falls) / scale) ** 2) ** 2)
        normal = hat_steps.T @ (weight[:, None] * hat_steps)
        size = float(np.trace(normal)) / KNOTS
        if not size > 0:
            return np.zeros(KNOTS)
        root = np.linalg.cholesky(normal + _STEADY * size * np.eye(KNOTS))
        right_side = np.linalg.solve(root, hat_steps.T @ (weight * light_steps))
        falls = scipy.optimize.nnls(root.T, right_side)[0]
    return np.asarray(summed @ falls)
