"""The field of one unit of a periodic plate -> the amplitudes of its dots.

    c(m, n) = sinc(m / N) sinc(n / N) / N^2  sum over j, k of u(j, k) exp(-2 pi i (m j + n k) / N)

A cell is a square of even height, whose own diffraction is the two sinc. The intensities of all
orders there are sum to 1, if |u| = 1: the light that is not in the dots is known without them.
"""

import numpy as np
from numpy.typing import NDArray

from camkit.models_def.optics.dots.camera import ORDERS

ComplexGrid = NDArray[np.complex128]


def order_matrix(cells: int, orders: int = ORDERS) -> ComplexGrid:
    """Return the matrix A (orders, cells) that carries one axis of a unit to its orders.

    Args:
        cells: Along a side; places are counted from the middle.
        orders: Odd; the middle one is the light that goes straight on.

    References: Sun 2021, eq. (4.7), for a periodic plate of square cells.
    """
    order = np.arange(orders) - orders // 2
    place = np.arange(cells) - (cells - 1) / 2
    turns = np.outer(order, place) / cells
    return np.asarray(np.sinc(order / cells)[:, None] / cells * np.exp(-2j * np.pi * turns))


def orders_of(field: ComplexGrid, matrix: ComplexGrid) -> ComplexGrid:
    """Return the amplitudes (orders, orders) of a field (cells, cells), both [y, x].

    References: Sun 2021, eq. (4.7).
    """
    return matrix @ field @ matrix.T


def intensity(amplitude: ComplexGrid) -> NDArray[np.float64]:
    """Return the light of amplitudes.

    References: Sun 2021, eq. (4.8).
    """
    return amplitude.real**2 + amplitude.imag**2
