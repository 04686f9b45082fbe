"""What design time fits by eq. (6.11) is placed by the runtime where the fit says."""

import numpy as np

from camkit.models_def.optics.distortion import fit_distortion
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.distortion import distort_points

RADIUS_MM = 21.489
PITCH_MM = 5.96e-3
PARITY_PX = 1e-6


def test_the_runtime_places_points_by_the_fitted_polynomial() -> None:
    rng = np.random.default_rng(0)
    radii = np.linspace(1, RADIUS_MM, 24)
    distorted = radii * (1 - 0.05 * (radii / RADIUS_MM) ** 2) + rng.normal(0, 1e-3, 24)
    row = fit_distortion(radii / RADIUS_MM, distorted / RADIUS_MM)
    fitted = RadialDistortion(coefficients=np.tile(row, (3, 1)), radius_mm=RADIUS_MM)
    placed = distort_points(np.stack([radii, np.zeros_like(radii)], axis=1), fitted)[:, 0]
    r = radii / RADIUS_MM
    expected = np.stack([r, r**3, r**5, r**7], axis=1) @ row * RADIUS_MM
    assert np.abs(placed - expected).max() / PITCH_MM <= PARITY_PX
