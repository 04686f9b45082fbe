"""Amounts of light in the streaks of every light along its column, one colour.

    lights of the slant -> runs: neighbouring rows of one column that are light
                        -> what a run throws onto every row of its column: its field
                        -> one amount for every run, all columns at once

Streaks are told from the scene by their gradients, as those of a plate are (`streaks/descent.py`):
wherever there is no light, the gradient of what is seen less the streaks is that of the scene,
which is small nearly everywhere and large at edges. The penalty is that of Geman and McClure
(1987), narrowed step by step (Blake and Zisserman 1987). Runs of one column and of the next one
share gradients, no others do: the normal equations of a step are a band, solved outright. Amounts
that come out below 0 are held at 0 and the rest is solved again.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from camkit.arrays import FloatArray

SCALES: Final = (50.0, 20.0, 10.0, 5.0, 2.5, 1.2, 0.6, 0.3, 0.15)
"""Of the penalty, in units of the level of a place, from the first step to the last."""
LAST_SCALES: Final = SCALES[5:]
"""For amounts that were nearly found."""
EXCESS: Final = 0.3
"""What streaks pay that outshine what is seen, beside the gradients."""
PRICE: Final = 1e-4
"""Of a run's light, in units of what its field would cost as a gradient."""
MOST_RUNS: Final = 10
"""In a column; where there are more, those with the least between them become one."""
HOLDS: Final = 6
_ZERO_WEIGHT: Final = 1e12
_TINY: Final = 1e-12
Mask = NDArray[np.bool_]
Labels = NDArray[np.intp]
Amounts = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Columns of a slant that a light may reach, one after the other, of one colour.

    Attributes:
        light: (column, row) float32.
        usable: (column, row): neither light, nor beside one, nor outside the picture.
        level: (column, row) float32, > 0: how large a step of the scene may be there.
        joined: (column - 1,): whether a column and the next one are neighbours.
    """

    light: FloatArray
    usable: Mask
    level: FloatArray
    joined: Mask


def runs_of(lights: Mask) -> Labels:
    """Number the runs of every column of (row, column) from 1 on, 0 between them."""
    gap = 1
    while True:
        first = lights.copy()
        first[1:] &= ~lights[:-1]
        numbers = np.cumsum(first, axis=0) * lights
        if numbers.max(initial=0) <= MOST_RUNS:
            return np.asarray(numbers, np.intp)
        gap += 2
        padded = np.pad(lights, ((gap, gap), (0, 0)))
        closed = scipy.ndimage.binary_closing(padded, np.ones((gap, 1), bool))
        lights = closed[gap:-gap] | lights


def fields_of(runs: Labels, fading: FloatArray) -> FloatArray:
    """Return the light of every run on the rows of its column.

    Args:
        runs: (row, column) of `runs_of`.
        fading: (row,): light at so many rows' distance from one row of a light.

    Returns:
        (column, row, run) float32.
    """
    count = runs.shape[0]
    place = np.arange(count)
    spread = fading[np.abs(place[:, None] - place[None, :])].astype(np.float32)
    fields = [spread @ (runs == run + 1).astype(np.float32) for run in range(runs.max(initial=0))]
    if not fields:
        return np.zeros((runs.shape[1], count, 0), np.float32)
    return np.ascontiguousarray(np.stack(fields, axis=-1).transpose(1, 0, 2))


def seek_arms(
    columns: Columns, fields: FloatArray, scales: tuple[float, ...], first: Amounts | None = None
) -> Amounts:
    """Return the amount of every run.

    Args:
        columns: Of one colour.
        fields: (column, row, run) of the same columns.
        scales: Of the penalty.
        first: (column, run) amounts to start from; None for none.

    Returns:
        (column, run) >= 0; 0 where a column has no such run.
    """
    amounts = np.zeros(fields[:, 0].shape) if first is None else first
    dead = np.asarray(~(fields > 0).any(axis=1))
    for scale in scales:
        equations = _equations(columns, fields, amounts, scale)
        at_zero: Mask = dead.copy()
        for _ in range(HOLDS):
            amounts = equations.solved(at_zero)
            negative = (amounts < 0) & ~at_zero
            if not negative.any():
                break
            at_zero = at_zero | negative
        amounts = np.where(at_zero, 0, np.maximum(amounts, 0))
    return amounts


def arm_streaks(fields: FloatArray, amounts: Amounts) -> FloatArray:
    """Return the streaks (column, row) of all runs."""
    return np.asarray(np.matmul(fields, amounts.astype(np.float32)[:, :, None])[:, :, 0])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Equations:
    """Normal equations of one step: blocks of a column's runs, and to those of the next one."""

    diagonal: NDArray[np.float64]
    coupling: NDArray[np.float64]
    right_side: NDArray[np.float64]

    def solved(self, at_zero: Mask) -> Amounts:
        """Solve with some amounts held at 0."""
        count, runs, _ = self.diagonal.shape
        band = np.zeros((2 * runs, count * runs))
        for row in range(runs):
            for column in range(row + 1):
                band[row - column, column::runs] = self.diagonal[:, row, column]
            for column in range(runs):
                blocks = band[runs + row - column, column::runs]
                blocks[: count - 1] = self.coupling[:, row, column]
        band[0][at_zero.ravel()] = _ZERO_WEIGHT * max(float(band[0].max()), 1.0)
        right_side = np.where(at_zero, 0, self.right_side).ravel()
        solution = scipy.linalg.solveh_banded(band, right_side, lower=True, check_finite=False)
        return np.asarray(solution).reshape(count, runs)


def _equations(columns: Columns, fields: FloatArray, amounts: Amounts, scale: float) -> _Equations:
    light, usable = columns.light, columns.usable
    level = np.asarray(np.float32(scale) * columns.level)
    streaks = arm_streaks(fields, amounts)
    across = usable[1:] & usable[:-1] & columns.joined[:, None]
    along = usable[:, 1:] & usable[:, :-1]
    step_x, step_y = np.diff(light, axis=0), np.diff(light, axis=1)
    weight_x = _weight(step_x - np.diff(streaks, axis=0), 0.5 * (level[1:] + level[:-1]), across)
    weight_y = _weight(step_y - np.diff(streaks, axis=1), (level[:, 1:] + level[:, :-1]) / 2, along)
    excess = np.where(usable & (streaks > light), np.float32(EXCESS) / level**2, 0)
    sloped = np.diff(fields, axis=1)
    whole = excess.copy()
    whole[1:] += weight_x
    whole[:-1] += weight_x
    diagonal = _product(fields, whole, fields) + _product(sloped, weight_y, sloped)
    price = PRICE * np.matmul(fields.transpose(0, 2, 1) ** 2, level[:, :, None] ** -2)[:, :, 0]
    runs = np.arange(fields.shape[2])
    diagonal[:, runs, runs] += price + _TINY
    coupling = -_product(fields[1:], weight_x, fields[:-1])
    right_side = _gathered(fields, excess * light) + _gathered(sloped, weight_y * step_y)
    right_side[1:] += _gathered(fields[1:], weight_x * step_x)
    right_side[:-1] -= _gathered(fields[:-1], weight_x * step_x)
    return _Equations(diagonal=diagonal, coupling=coupling, right_side=right_side)


def _weight(rest: FloatArray, scale: NDArray[np.floating], where: Mask) -> FloatArray:
    """Return the weights of Geman and McClure, 0 outside a mask."""
    weight = 1 / (scale**2 * (1 + (rest / scale) ** 2) ** 2)
    return np.asarray(np.where(where, weight, 0), np.float32)


def _product(left: FloatArray, weight: FloatArray, right: FloatArray) -> NDArray[np.float64]:
    return np.asarray(np.matmul(left.transpose(0, 2, 1), weight[:, :, None] * right), np.float64)


def _gathered(fields: FloatArray, image: FloatArray) -> NDArray[np.float64]:
    return np.asarray(np.matmul(fields.transpose(0, 2, 1), image[:, :, None])[:, :, 0], np.float64)
