"""Phases by the slope of the merit, from where Gerchberg and Saxton end."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from camkit.models_def.optics.dots.merit import Merit
from camkit.models_def.optics.dots.orders import intensity, order_matrix, orders_of
from camkit.models_def.optics.dots.target import FloatGrid

STEPS: Final = 400
_MEMORY: Final = 20


def refine(phase: FloatGrid, merit: Merit, steps: int = STEPS) -> tuple[FloatGrid, float]:
    """Refine phases by L-BFGS.

    Args:
        phase: (cells, cells) radians to begin at.
        merit: To be made small.
        steps: At most.

    Returns:
        Phases, and their merit.

    References: Byrd, Lu, Nocedal, Zhu 1995 (L-BFGS-B, of scipy).
    """
    cells = phase.shape[0]
    matrix = order_matrix(cells, merit.target.shape[0])

    def judged(flat: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        field = np.exp(1j * flat.reshape(cells, cells))
        dots = orders_of(field, matrix)
        light = intensity(dots)
        pulled = matrix.T @ (merit.slope(light) * dots.conj()) @ matrix
        return float(merit.of(light)), np.asarray(-2 * (field * pulled).imag).ravel()

    optimum = minimize(
        judged,
        phase.ravel(),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": steps, "maxcor": _MEMORY},
    )
    return np.asarray(optimum.x).reshape(cells, cells), float(optimum.fun)
