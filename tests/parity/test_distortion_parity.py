"""The fit of eq. (6.11) at design time and at use time give the same sensor positions."""

import numpy as np

from camkit.models_def.optics import distortion as design
from camkit.runtime.geometry.distortion import distort_points, fit_distortion

RADIUS_MM = 21.489
PITCH_MM = 5.96e-3
PARITY_PX = 1e-6


def test_both_fits_place_points_alike() -> None:
    rng = np.random.default_rng(0)
    radii = np.linspace(1, RADIUS_MM, 24)
    distorted = radii * (1 - 0.05 * (radii / RADIUS_MM) ** 2) + rng.normal(0, 1e-3, 24)
    row = design.fit_distortion(radii / RADIUS_MM, distorted / RADIUS_MM)
    found = fit_distortion(radii, distorted, RADIUS_MM)
    points = np.stack([radii, np.zeros_like(radii)], axis=1)
    placed = distort_points(points, found)[:, 0]
    r = radii / RADIUS_MM
    expected = np.stack([r, r**3, r**5, r**7], axis=1) @ row * RADIUS_MM
    assert np.abs(placed - expected).max() / PITCH_MM <= PARITY_PX
