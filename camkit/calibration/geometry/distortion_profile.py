"""Distortion along a radius: how far it is known, whether it folds, and as the usual polynomial.

Radii are in px from the optical centre: ideal ones are focal * tan(angle), of a lens without
distortion; the others lie on the picture. Tangential terms are left out.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from camkit.calibration.geometry.camera_model import Camera, FloatGrid
from camkit.errors import ContractError
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.distortion import RANGE_MARGIN, check_distortion

PINHOLE_WIDEST_RAD: Final = np.radians(89.0)
FISHEYE_WIDEST_RAD: Final = np.radians(175.0)
SAMPLES: Final = 4096
FITTED: Final = 512
HOLDS: Final = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0)
"""Weights tried of what is not known, against what is."""
_TERMS: Final = 4
_GUESSED_RAD: Final = np.radians(80.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profile:
    """The profile of a camera, to where it was seen.

    Attributes:
        angles_rad: (sample,) from the axis, as far as radii grow.
        radii_px: (sample,) on the picture.
        focal_px: Of the camera.
        covered_px: Radius on the picture to which corners were seen; nothing is said beyond.
    """

    angles_rad: FloatGrid
    radii_px: FloatGrid
    focal_px: float
    covered_px: float

    @property
    def fold_px(self) -> float:
        """Return the largest radius that the profile reaches before it folds back or ends."""
        return float(self.radii_px[-1])

    def ideal_px(self, radii_px: FloatGrid) -> FloatGrid:
        """Return ideal radii of radii on the picture.

        Raises:
            ContractError: If one lies beyond what was covered.
        """
        farthest = float(np.max(radii_px, initial=0))
        if farthest > self.covered_px * (1 + 1e-9):
            raise ContractError(
                f"the distortion is known to {self.covered_px:.1f} px from the optical centre; "
                f"got {farthest:.1f} px: photograph the board farther out"
            )
        angles = np.interp(radii_px, self.radii_px, self.angles_rad)
        return np.asarray(self.focal_px * np.tan(angles))


def profile_of(camera: Camera, covered_px: float) -> Profile:
    """Return the profile of a camera.

    Args:
        camera: The camera.
        covered_px: Radius to which corners were seen.
    """
    fisheye = camera.model.fisheye
    angles = np.linspace(0, FISHEYE_WIDEST_RAD if fisheye else PINHOLE_WIDEST_RAD, SAMPLES)
    radii = camera.focal_px * (_bent(camera, angles) if fisheye else _spread(camera, angles))
    grows = np.isfinite(radii[1:]) & (np.diff(radii) > 0)
    end = len(radii) if grows.all() else int(np.argmin(grows)) + 1
    return Profile(
        angles_rad=angles[:end],
        radii_px=radii[:end],
        focal_px=camera.focal_px,
        covered_px=covered_px,
    )


def _bent(camera: Camera, angles: FloatGrid) -> FloatGrid:
    k1, k2, k3, k4 = camera.coefficients
    u = angles**2
    return np.asarray(angles * (1 + u * (k1 + u * (k2 + u * (k3 + u * k4)))))


def _spread(camera: Camera, angles: FloatGrid) -> FloatGrid:
    k1, k2, _, _, k3, k4, k5, k6 = camera.coefficients
    r = np.tan(angles)
    u = r**2
    divisor = 1 + u * (k4 + u * (k5 + u * k6))
    # beyond the first pole there is no profile
    divisor = np.where(np.minimum.accumulate(divisor) > 0, divisor, np.nan)
    return np.asarray(r * (1 + u * (k1 + u * (k2 + u * k3))) / divisor)


@dataclass(frozen=True, slots=True, kw_only=True)
class RadialFit:
    """The polynomial that `undistort` takes.

    Attributes:
        coefficients: xi * (1, k1, k2, k3), for radii in units of `radius_px`.
        radius_px: Half the diagonal of the picture.
        residual_px: The most that it misses the profile by, as far as that is known.
    """

    coefficients: tuple[float, float, float, float]
    radius_px: float
    residual_px: float

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "coefficients": list(self.coefficients),
            "radius_px": self.radius_px,
            "residual_px": round(self.residual_px, 5),
        }


def fit_radial(profile: Profile, radius_px: float, corner_px: float) -> RadialFit:
    """Fit r_d = xi r (1 + k1 r^2 + k2 r^4 + k3 r^6) to a profile, as far as it is known.

    Left alone, a polynomial may fold beyond what is known and before the corners of the picture.
    Then it is held there lightly: to the model's own guess, or to the straight line on which the
    profile leaves what is known; or it gets fewer terms. Of those that do not fold, that which
    misses the profile least is taken.

    Args:
        profile: Of the camera.
        radius_px: The unit of r and r_d.
        corner_px: How far the farthest corner of the picture lies from the optical centre.

    References: Sun 2021, eq. (6.10) and (6.11).
    """
    radii_px = np.linspace(0, profile.covered_px, FITTED)
    samples = np.stack([profile.ideal_px(radii_px), radii_px], axis=1) / radius_px
    extensions = [extension / radius_px for extension in _continued(profile, corner_px)]
    attempts = [
        (samples[:0], 0.0),
        *((extension, weight) for extension in extensions for weight in HOLDS),
    ]
    for terms in range(_TERMS, 0, -1):
        fits = [
            _fitted(samples, extension, weight, terms, radius_px) for extension, weight in attempts
        ]
        usable = [fit for fit in fits if _is_usable(fit, corner_px)]
        if usable:
            return min(usable, key=lambda fit: fit.residual_px)
    raise ContractError(f"no polynomial reaches {corner_px:.0f} px from the optical centre")


def _continued(profile: Profile, corner_px: float) -> list[FloatGrid]:
    """Return (sample, 2) ideal and placed radii beyond the known ones, extrapolated in two ways."""
    radii_px = np.linspace(profile.covered_px, RANGE_MARGIN * corner_px, FITTED)[1:]
    angles = np.interp(radii_px, profile.radii_px, profile.angles_rad)
    fisheye = np.stack(
        [profile.focal_px * np.tan(np.minimum(angles, _GUESSED_RAD)), radii_px], axis=1
    )
    inner, outer = profile.ideal_px(profile.covered_px * np.array([0.99, 1.0]))
    slope = 0.01 * profile.covered_px / (outer - inner)
    straight = np.stack([outer + (radii_px - profile.covered_px) / slope, radii_px], axis=1)
    return [fisheye[angles < _GUESSED_RAD], straight]


def _fitted(
    samples: FloatGrid, extension: FloatGrid, weight: float, terms: int, radius_px: float
) -> RadialFit:
    """Fit some terms to the known radii, and with a weight to the extrapolated ones."""
    powers = 2 * np.arange(terms) + 1
    root = np.concatenate([np.ones(len(samples)), np.full(len(extension), np.sqrt(weight))])
    every = np.concatenate([samples, extension])
    solution = np.linalg.lstsq(
        every[:, :1] ** powers * root[:, None], every[:, 1] * root, rcond=None
    )[0]
    missed = np.abs(samples[:, :1] ** powers @ solution - samples[:, 1]).max()
    one, two, three, four = np.pad(solution, (0, _TERMS - terms)).tolist()
    return RadialFit(
        coefficients=(one, two, three, four),
        radius_px=radius_px,
        residual_px=float(missed) * radius_px,
    )


def _is_usable(fit: RadialFit, corner_px: float) -> bool:
    """Return whether the runtime would undistort by a polynomial; px stand for its mm."""
    distortion = RadialDistortion(
        coefficients=np.array([fit.coefficients]), radius_mm=fit.radius_px
    )
    try:
        check_distortion(distortion, corner_px)
    except ContractError:
        return False
    return True
