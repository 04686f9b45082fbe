"""Phases by turns between plate and picture: the thesis's way, and the start of a finer one."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.models_def.optics.dots.orders import ComplexGrid, order_matrix, orders_of
from camkit.models_def.optics.dots.target import FloatGrid

ROUNDS: Final = 50


def gerchberg_saxton(
    target: FloatGrid, cells: int, rng: np.random.Generator, rounds: int = ROUNDS
) -> FloatGrid:
    """Return phases (cells, cells) in radians whose dots are near a light that is wanted.

    In each round the phase of the plate is kept and its amplitude made 1, the phase of the dots is
    kept and their amplitude made the root of the target; other orders are left dark.

    Args:
        target: (n, n), n odd, of unit sum.
        cells: Along a side of the unit.
        rng: For the first phases of the dots.
        rounds: At least 1.

    References: Sun 2021, section 4.3.3 and eq. (4.7), (4.8); Gerchberg and Saxton 1972. The sinc
        of the cells is divided out on the way back, which the thesis's point-like cells lack.
    """
    matrix = order_matrix(cells, target.shape[0])
    norm = np.abs(matrix[:, 0]) * cells
    amplitude = np.sqrt(target)
    back = (matrix / norm[:, None] ** 2).conj().T
    dots = np.asarray(amplitude * np.exp(2j * np.pi * rng.random(target.shape)))
    for _ in range(rounds):
        field = _unit(back @ dots @ back.T)
        dots = amplitude * _unit(orders_of(field, matrix))
    return np.angle(field)


def _unit(field: ComplexGrid) -> ComplexGrid:
    """Return a field of the same phase and amplitude 1; phase 0 where there is no light."""
    size: NDArray[np.float64] = np.abs(field)
    return np.where(size > 0, field / np.where(size > 0, size, 1.0), 1.0)
