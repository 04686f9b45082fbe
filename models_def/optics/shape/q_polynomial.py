"""Forbes' Q polynomials as powers of x = (r / R)^2.

Q_con are Jacobi polynomials P^(0,4)(2 x - 1). Q_bfs are orthonormal in slope; they follow from
auxiliary polynomials P_0 = 2, P_1 = 6 - 8 x, P_m = (2 - 4 x) P_(m-1) - P_(m-2) by a recurrence of
three terms.

References: Forbes, "Shape specification for axially symmetric optical surfaces", Opt. Express 15
(2007) 5218; the recurrence: "Robust, efficient computational methods for axially symmetric
optical aspheres", Opt. Express 18 (2010) 19700.
"""

import functools
import math
from typing import Final, Literal

import numpy as np
from numpy.polynomial import polynomial as powers
from numpy.typing import NDArray

from camkit.errors import UnsupportedError

QKind = Literal["bfs", "con"]
MOST_TERMS: Final = 14
"""Powers of x lose a digit per 1.3 terms: with 14 a height is exact to 1e-6 of its coefficient."""

Array = NDArray[np.float64]


@functools.cache
def q_powers(kind: QKind, count: int) -> tuple[Array, ...]:
    """Return the coefficients of 1, x, x^2, ... of Q_0, Q_1, ...

    Raises:
        UnsupportedError: If there are too many for powers.
    """
    if count > MOST_TERMS:
        raise UnsupportedError(f"a Q asphere has at most {MOST_TERMS} terms; got {count}")
    rows = _bfs(count) if kind == "bfs" else _con(count)
    return tuple(rows[:count])


def _con(count: int) -> list[Array]:
    rows = []
    for m in range(count):
        # P_m^(0,4)(2 x - 1) = sum_s C(m, m-s) C(m+4, s) (x-1)^s x^(m-s), in whole numbers
        whole = [0] * (m + 1)
        for s in range(m + 1):
            factor = math.comb(m, m - s) * math.comb(m + 4, s)
            for i in range(s + 1):
                whole[m - s + i] += factor * math.comb(s, i) * (-1) ** (s - i)
        rows.append(np.array(whole, dtype=np.float64))
    return rows


def _bfs(count: int) -> list[Array]:
    p = [np.array([2.0]), np.array([6.0, -8.0])]
    q = [np.array([1.0]), np.array([13.0, -16.0]) / math.sqrt(19)]
    f, g, h = [2.0, math.sqrt(19) / 2], [-0.5], []
    for m in range(2, count):
        p.append(powers.polysub(powers.polymul([2.0, -4.0], p[m - 1]), p[m - 2]))
        h.append(-m * (m - 1) / (2 * f[m - 2]))
        g.append(-(1 + g[m - 2] * h[m - 2]) / f[m - 1])
        f.append(math.sqrt(m * (m + 1) + 3 - g[m - 1] ** 2 - h[m - 2] ** 2))
        rest = powers.polysub(p[m], g[m - 1] * q[m - 1])
        q.append(powers.polysub(rest, h[m - 2] * q[m - 2]) / f[m])
    return q


@functools.cache
def q_matrix(kind: QKind, count: int) -> Array:
    """Return the matrix (power, term) from Q coefficients to those of t, t^2, ..., t = (r / R)^2.

    The height beyond the conic is t^2 sum a_m Q_m(t) for `con`, and t (1 - t) sum a_m Q_m(t) / S
    for `bfs`, where S is left out here.
    """
    front = [0.0, 0.0, 1.0] if kind == "con" else [0.0, 1.0, -1.0]
    matrix = np.zeros((count + 1, count))
    for m, row in enumerate(q_powers(kind, count)):
        product = powers.polymul(front, row)[1:]
        matrix[: len(product), m] = product
    return matrix
