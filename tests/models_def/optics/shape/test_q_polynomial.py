import numpy as np
import pytest
from numpy.polynomial import polynomial as powers
from scipy.special import eval_jacobi

from camkit.errors import UnsupportedError
from camkit.models_def.optics.shape.q_polynomial import MOST_TERMS, q_matrix, q_powers

X = np.linspace(0, 1, 201)


def test_q_bfs_are_those_that_forbes_prints() -> None:
    """Forbes 2007, eq. (3.6): the first three."""
    rows = q_powers("bfs", 3)
    assert rows[0] == pytest.approx([1.0])
    assert rows[1] == pytest.approx(np.array([13, -16]) / np.sqrt(19))
    assert rows[2] == pytest.approx(np.sqrt(2 / 95) * np.array([29, -100, 76]))


def test_slopes_of_q_bfs_are_orthonormal() -> None:
    """The mean over theta, u = sin theta, of slopes of u^2 (1 - u^2) Q_m (Forbes 2007, 3.4)."""
    theta = (np.arange(4000) + 0.5) / 4000 * np.pi / 2
    u = np.sin(theta)
    slopes = []
    for row in q_powers("bfs", 8):
        height = powers.polymul([0.0, 1.0, -1.0], row)
        slopes.append(2 * u * powers.polyval(u**2, powers.polyder(height)))
    product = np.array(slopes) @ np.array(slopes).T / len(theta)
    assert np.abs(product - np.eye(8)).max() < 1e-9


def test_q_con_are_jacobi_polynomials() -> None:
    for m, row in enumerate(q_powers("con", MOST_TERMS)):
        wanted = eval_jacobi(m, 0, 4, 2 * X - 1)
        assert np.abs(powers.polyval(X, row) - wanted).max() < 1e-6


def test_powers_of_q_bfs_keep_their_digits() -> None:
    """Against the same recurrence on values, which loses none."""
    p, q = [2 + 0 * X, 6 - 8 * X], [1 + 0 * X, (13 - 16 * X) / np.sqrt(19)]
    f, g = [2.0, np.sqrt(19) / 2], [-0.5]
    for m in range(2, MOST_TERMS):
        p.append((2 - 4 * X) * p[-1] - p[-2])
        h = -m * (m - 1) / (2 * f[m - 2])
        g.append(-(1 + g[m - 2] * h) / f[m - 1])
        f.append(np.sqrt(m * (m + 1) + 3 - g[m - 1] ** 2 - h**2))
        q.append((p[m] - g[m - 1] * q[m - 1] - h * q[m - 2]) / f[m])
    for row, wanted in zip(q_powers("bfs", MOST_TERMS), q, strict=True):
        assert np.abs(powers.polyval(X, row) - wanted).max() < 1e-6


def test_matrix_holds_the_factor_in_front() -> None:
    assert q_matrix("con", 2).tolist() == [[0, 0], [1, -5], [0, 6]]
    assert q_matrix("bfs", 1)[:, 0].tolist() == [1, -1]


def test_more_terms_than_powers_can_hold_are_refused() -> None:
    with pytest.raises(UnsupportedError, match="at most 14"):
        q_powers("bfs", MOST_TERMS + 1)
