"""Radial distortion of points: the model, its inverse, its range.

r_d = xi r (1 + k1 r^2 + k2 r^4 + k3 r^6), r ideal and r_d on the sensor, both in units of
`RadialDistortion.radius_mm` (Sun 2021, eq. 6.10), plus even powers, b0 r^2 + b1 r^4 + b2 r^6, where
a lens has them. Pictures are warped in `warp.py`.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.radial import RadialDistortion

FloatGrid = NDArray[np.float64]

TABLE_SAMPLES: Final = 1024
NEWTON_STEPS: Final = 4
LEAST_SCALE: Final = 1e-3
ODD_TERMS: Final = 4
# A fold beyond a million half diagonals is none.
FLAT_ROOT: Final = 1e-12
# A picture is warped a little beyond the farthest pixel, where filters reach over the border.
RANGE_MARGIN: Final = 1.02


def reference_channel(distortion: RadialDistortion) -> int:
    """Return the channel that pictures are centred by: the middle one, green of three."""
    return int(distortion.coefficients.shape[0]) // 2


def distort_points(
    points_mm: FloatGrid, distortion: RadialDistortion, *, channel: int = 1
) -> FloatGrid:
    """Return the places of ideal image points on the sensor.

    Args:
        points_mm: (..., 2) x, y from the axis.
        distortion: The model.
        channel: Number of the channel.

    References: Sun 2021, eq. (6.10).
    """
    square = (points_mm**2).sum(axis=-1, keepdims=True) / distortion.radius_mm**2
    return np.asarray(points_mm * _growth(distortion.row(channel), square))


def undistort_points(
    points_mm: FloatGrid, distortion: RadialDistortion, *, channel: int = 1
) -> FloatGrid:
    """Return the ideal image points of points on the sensor: inverse of `distort_points`.

    Newton's method from a table of the forward model; exact to about 1e-9 mm.

    Args:
        points_mm: (..., 2) x, y from the axis, on the sensor.
        distortion: The model.
        channel: Number of the channel.

    Raises:
        ContractError: If a point lies where the model has no single inverse.
    """
    coefficients = distortion.row(channel)
    radius = np.sqrt((points_mm**2).sum(axis=-1, keepdims=True)) / distortion.radius_mm
    limit = ideal_limit(coefficients, float(radius.max(initial=0.0)))
    table = np.linspace(0.0, limit, TABLE_SAMPLES)
    ideal = np.interp(radius, _distorted_radius(coefficients, table), table)
    for _ in range(NEWTON_STEPS):
        ideal -= (_distorted_radius(coefficients, ideal) - radius) / _slope(coefficients, ideal)
    scale = np.divide(
        ideal, radius, out=np.full_like(radius, 1 / coefficients[0]), where=radius > 0
    )
    return np.asarray(points_mm * scale)


def check_distortion(distortion: RadialDistortion, corner_radius_mm: float) -> None:
    """Refuse a model that folds on the sensor, or over the ideal picture of the same size.

    Raises:
        ContractError: If r_d does not grow with r out to the corner, in any colour.
    """
    corner = corner_radius_mm / distortion.radius_mm * RANGE_MARGIN
    for channel in range(len(distortion.coefficients)):
        coefficients = distortion.row(channel)
        fold = _fold_radius(coefficients)
        if fold <= corner:
            raise ContractError(
                f"the distortion folds at {fold * distortion.radius_mm:.2f} mm, inside the corner "
                f"at {corner_radius_mm:.2f} mm; fit it again over the whole sensor"
            )
        ideal_limit(coefficients, corner)


def ideal_limit(coefficients: FloatGrid, radius: float) -> float:
    """Return an ideal radius whose image is at or beyond `radius` on the sensor, before any fold.

    Args:
        coefficients: (4,) of one colour, or (7,) with even powers.
        radius: Radius on the sensor in units of radius_mm.

    Raises:
        ContractError: If the model folds or ends before it reaches that radius.
    """
    fold = _fold_radius(coefficients)
    limit = max(radius, 1e-6) / coefficients[0] if coefficients[0] > 0 else 0.0
    for _ in range(32):
        limit = min(limit, fold)
        if limit > 0 and _distorted_radius(coefficients, np.asarray(limit)) >= radius:
            return float(limit)
        if limit == fold:
            break
        limit *= 1.25
    raise ContractError(
        f"the distortion has no inverse at {radius:.3f} of its unit (it folds at ideal "
        f"radius {fold:.3f}); fit it again over the whole sensor"
    )


def _growth(c: FloatGrid, u: FloatGrid) -> FloatGrid:
    """Return r_d / r at squared radii."""
    odd = c[0] + u * (c[1] + u * (c[2] + u * c[3]))
    if len(c) == ODD_TERMS:
        return np.asarray(odd)
    return np.asarray(odd + np.sqrt(u) * (c[4] + u * (c[5] + u * c[6])))


def _distorted_radius(c: FloatGrid, r: FloatGrid) -> FloatGrid:
    return np.asarray(r * _growth(c, r * r))


def _slope(c: FloatGrid, r: FloatGrid) -> FloatGrid:
    u = r * r
    odd = c[0] + u * (3 * c[1] + u * (5 * c[2] + u * 7 * c[3]))
    if len(c) == ODD_TERMS:
        return np.asarray(odd)
    return np.asarray(odd + r * (2 * c[4] + u * (4 * c[5] + u * 6 * c[6])))


def _fold_radius(c: FloatGrid) -> float:
    # r_d stops growing where its slope, a cubic in u = r^2, has its first positive root. Solved
    # for v = 1 / u, whose highest coefficient is the scale xi and never vanishes. With even powers
    # the slope is a polynomial in r, solved for 1 / r likewise.
    if c[0] < LEAST_SCALE:
        return 0.0
    if len(c) > ODD_TERMS and c[ODD_TERMS:].any():
        slopes = [c[0], 2 * c[4], 3 * c[1], 4 * c[5], 5 * c[2], 6 * c[6], 7 * c[3]]
        last = _last_root(np.array(slopes) / c[0])
        return 1 / last if last > FLAT_ROOT**0.5 else float("inf")
    last = _last_root(np.array([1.0, 3 * c[1] / c[0], 5 * c[2] / c[0], 7 * c[3] / c[0]]))
    return last**-0.5 if last > FLAT_ROOT else float("inf")


def _last_root(polynomial: FloatGrid) -> float:
    """Return the largest real root > 0 of a polynomial, highest power first; 0 for none."""
    roots = np.roots(polynomial)
    real = roots[np.abs(roots.imag) <= 1e-9 * (1 + np.abs(roots.real))].real
    return float(real.max(initial=0.0))
