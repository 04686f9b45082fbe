"""One profile for all directions, each in its virtual aperture (eq. 3.4), in the meridian.

It leaves astigmatism free and ends with dull corners, so it is where the skew rays of `solver`
begin, not where the plate ends.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.thin.ideal import ideal_phase

Array = NDArray[np.float64]
_POINTS = 41


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualApertures:
    """The part of the aperture that makes the peak of each direction.

    Attributes:
        field_angles_rad: (direction,), from the axis to the corner.
        centres_mm: (direction,), where each disc lies on the front face, along +y.
        radius_mm: Of the discs.
    """

    field_angles_rad: tuple[float, ...]
    centres_mm: tuple[float, ...]
    radius_mm: float

    def __post_init__(self) -> None:
        if len(self.field_angles_rad) != len(self.centres_mm):
            raise ContractError("virtual apertures need a centre for every direction")
        if not self.radius_mm > 0:
            raise ContractError(f"a virtual aperture needs a radius > 0; got {self.radius_mm}")


def partitioned_phase(
    apertures: VirtualApertures, distance_mm: float, wavelength_um: float, terms: int
) -> Array:
    """Return the even polynomial whose phase is nearest to that of every direction in its aperture.

    The heights of the image points are f tan(angle): the power of the profile is left to it.
    Linear least squares, with a constant phase for each direction, which moves no light.

    Args:
        apertures: Directions and discs.
        distance_mm: From the plate to the sensor.
        wavelength_um: Of the light.
        terms: How many: r^2, r^4, ...

    Returns:
        (terms,), radians per mm^2, mm^4, ...

    References: Sun 2021, eq. (3.4).
    """
    offsets_mm = np.linspace(-apertures.radius_mm, apertures.radius_mm, _POINTS)
    # the chord of the disc over the meridian is what a point of it stands for
    chord = np.sqrt(np.sqrt(np.clip(apertures.radius_mm**2 - offsets_mm**2, 0, None)))
    count = len(apertures.centres_mm)
    rows, targets = [], []
    for i, (angle_rad, centre_mm) in enumerate(
        zip(apertures.field_angles_rad, apertures.centres_mm, strict=True)
    ):
        radius = centre_mm + offsets_mm
        height_mm = distance_mm * float(np.tan(angle_rad))
        constant = np.zeros((len(radius), count))
        constant[:, i] = 1
        powers = radius[:, None] ** (2 * np.arange(1, terms + 1))
        rows.append(np.concatenate([powers, constant], axis=1) * chord[:, None])
        phase = ideal_phase(radius, angle_rad, height_mm, distance_mm, wavelength_um)
        targets.append(phase * chord)
    matrix = np.concatenate(rows)
    # columns of one length: powers of r differ by many decades
    scale = np.linalg.norm(matrix, axis=0)
    solution, *_ = np.linalg.lstsq(matrix / scale, np.concatenate(targets), rcond=None)
    return np.asarray((solution / scale)[:terms])
