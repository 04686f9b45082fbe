"""Radial distortion of points: the model, its inverse, its range.

r_d = xi r (1 + k1 r^2 + k2 r^4 + k3 r^6), r ideal and r_d on the sensor, both in units of
`RadialDistortion.radius_mm` (Sun 2021, eq. 6.10). Pictures are warped in `warp.py`.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import RadialDistortion
from camkit.errors import ContractError

FloatGrid = NDArray[np.float64]

TABLE_SAMPLES: Final = 1024
NEWTON_STEPS: Final = 4
LEAST_SCALE: Final = 1e-3
# A fold beyond a million half diagonals is none.
FLAT_ROOT: Final = 1e-12
# A picture is warped a little beyond the farthest pixel, where filters reach over the border.
RANGE_MARGIN: Final = 1.02


def reference_channel(distortion: RadialDistortion) -> int:
    """Give the channel that pictures are centred by: the middle one, green of three."""
    return int(distortion.coefficients.shape[0]) // 2


def distort_points(
    points_mm: FloatGrid, distortion: RadialDistortion, *, channel: int = 1
) -> FloatGrid:
    """Give where ideal image points fall on the sensor.

    Args:
        points_mm: (..., 2) x, y from the axis.
        distortion: The model.
        channel: Number of the channel.

    References: Sun 2021, eq. (6.10).
    """
    square = (points_mm**2).sum(axis=-1, keepdims=True) / distortion.radius_mm**2
    c0, c1, c2, c3 = distortion.coefficients[channel]
    return np.asarray(points_mm * (c0 + square * (c1 + square * (c2 + square * c3))))


def undistort_points(
    points_mm: FloatGrid, distortion: RadialDistortion, *, channel: int = 1
) -> FloatGrid:
    """Give the ideal image points of points on the sensor: inverse of `distort_points`.

    Newton's method from a table of the forward model; exact to about 1e-9 mm.

    Args:
        points_mm: (..., 2) x, y from the axis, on the sensor.
        distortion: The model.
        channel: Number of the channel.

    Raises:
        ContractError: If a point lies where the model has no single inverse.
    """
    coefficients = distortion.coefficients[channel]
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
    for coefficients in distortion.coefficients:
        fold = _fold_radius(coefficients)
        if fold <= corner:
            raise ContractError(
                f"the distortion folds at {fold * distortion.radius_mm:.2f} mm, inside the corner "
                f"at {corner_radius_mm:.2f} mm; fit it again over the whole sensor"
            )
        ideal_limit(coefficients, corner)


def ideal_limit(coefficients: FloatGrid, radius: float) -> float:
    """Give an ideal radius whose image is at or beyond `radius` on the sensor, before any fold.

    Args:
        coefficients: (4,) of one colour.
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
        f"the distortion has no inverse at {radius:.3f} of the half diagonal (it folds at ideal "
        f"radius {fold:.3f}); fit it again over the whole sensor"
    )


def _distorted_radius(c: FloatGrid, r: FloatGrid) -> FloatGrid:
    u = r * r
    return np.asarray(r * (c[0] + u * (c[1] + u * (c[2] + u * c[3]))))


def _slope(c: FloatGrid, r: FloatGrid) -> FloatGrid:
    u = r * r
    return np.asarray(c[0] + u * (3 * c[1] + u * (5 * c[2] + u * 7 * c[3])))


def _fold_radius(c: FloatGrid) -> float:
    # r_d stops growing where its slope, a cubic in u = r^2, has its first positive root. Solved
    # for v = 1 / u, whose highest coefficient is the scale xi and never vanishes.
    if c[0] < LEAST_SCALE:
        return 0.0
    roots = np.roots([1.0, 3 * c[1] / c[0], 5 * c[2] / c[0], 7 * c[3] / c[0]])
    real = roots[np.abs(roots.imag) <= 1e-9 * (1 + np.abs(roots.real))].real
    last = float(real.max(initial=0.0))
    return last**-0.5 if last > FLAT_ROOT else float("inf")
