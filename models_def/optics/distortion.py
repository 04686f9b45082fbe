"""Radial distortion of a lens as the polynomial of eq. (6.10), fitted to traced chief rays."""

from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.spot import tangents_for_heights
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.distortion import distort_points, reference_channel
from camkit.units import UM_PER_MM

FIT_POINTS: Final = 16
SAME_LENS_PX: Final = 0.01
_POWERS: Final = np.array([1, 3, 5, 7])


def fit_distortion(
    ideal: NDArray[np.float64], distorted: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Fit xi (1, k1, k2, k3) of r_d = xi r (1 + k1 r^2 + k2 r^4 + k3 r^6) by least squares.

    Args:
        ideal: (point,), undistorted radii in units of half the diagonal.
        distorted: (point,), radii on the sensor in the same units.

    Returns:
        (4,) coefficients of r, r^3, r^5, r^7.

    Raises:
        ContractError: If there are fewer points than coefficients.

    References: Sun 2021, eq. (6.11).
    """
    if ideal.shape != distorted.shape or ideal.ndim != 1 or ideal.size < len(_POWERS):
        raise ContractError(
            f"need at least 4 point pairs; got shapes {ideal.shape} and {distorted.shape}"
        )
    solution, *_ = np.linalg.lstsq(ideal[:, None] ** _POWERS, distorted, rcond=None)
    return np.asarray(solution, dtype=np.float64)


def ideal_heights(lens: Lens, heights_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return EFL tan(field angle) in mm of the fields that land at sensor heights."""
    slopes = tangents_for_heights(lens, torch.from_numpy(heights_mm), "distortion")
    return paraxial_data(lens).efl_mm * slopes.numpy()


def trace_distortion(lens: Lens, radius_mm: float, *, channels: int = 3) -> RadialDistortion:
    """Fit the distortion of the reference wavelength over the whole sensor.

    All rows are equal: lateral colour lies in the kernels, which are centred on the chief
    ray of the reference wavelength.

    Args:
        lens: The prescription.
        radius_mm: Half the diagonal of the sensor.
        channels: Of the sensor.
    """
    heights_mm = np.linspace(radius_mm / FIT_POINTS, radius_mm, FIT_POINTS)
    ideal_mm = ideal_heights(lens, heights_mm)
    row = fit_distortion(ideal_mm / radius_mm, heights_mm / radius_mm)
    return RadialDistortion(coefficients=np.tile(row, (channels, 1)), radius_mm=radius_mm)


def check_distortion(lens: Lens, psf: FrozenPsf, path: Path) -> None:
    """Refuse a PSF that was frozen from another lens: no two have the same distortion.

    Raises:
        ContractError: Naming the file.
    """
    frozen = psf.distortion
    lens_distortion = trace_distortion(lens, frozen.radius_mm, channels=len(frozen.coefficients))
    points_mm = np.stack([np.linspace(0.0, frozen.radius_mm, 33), np.zeros(33)], axis=1)
    middle = reference_channel(frozen)
    off_mm = np.abs(
        distort_points(points_mm, lens_distortion, channel=middle)
        - distort_points(points_mm, frozen, channel=middle)
    ).max()
    refuse_other_lens(lens, path, float(off_mm * UM_PER_MM / psf.pixel_pitch_um), SAME_LENS_PX)


def refuse_other_lens(lens: Lens, path: Path, off_px: float, most_px: float) -> None:
    """Refuse a PSF whose places lie farther off those of a lens than the same lens may put them.

    Raises:
        ContractError: Naming the file.
    """
    if off_px > most_px:
        raise ContractError(
            f"{path} was not frozen from the lens {lens.name}: their distortion differs by "
            f"{off_px:.2g} px; freeze, train and export the same lens"
        )
