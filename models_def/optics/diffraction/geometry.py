"""A thin plate and a thin lens in one plane, a point light before them, a sensor behind.

The paths of light from the source through a place of the plate to the middle of the sensor, longer
or shorter than the one through the plate's middle. Source, lens and propagation are joined before
anything is sampled: what is left of them is small, though each alone turns by thousands of cycles.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

from torch import Tensor

from camkit.errors import ContractError

Aperture = Literal["circle", "square"]
APERTURES: Final[tuple[Aperture, ...]] = get_args(Aperture)
Phase = Literal["exact", "parabolic"]
PHASES: Final[tuple[Phase, ...]] = get_args(Phase)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """The arrangement of plate, lens and sensor. Lengths in mm.

    Attributes:
        diameter_mm: Of the aperture, in which the plate lies; the side of a square one.
        aperture: Its shape.
        focal_length_mm: Of the lens; inf for none.
        focus_mm: Distance of the object that is sharp without the plate; inf is allowed.
        sensor_mm: Distance of the sensor where there is no lens; else it follows from the focus.
        lens_phase: Of the lens: exact, sqrt(r^2 + f^2), or parabolic, r^2 / 2 f.
        kernel: Of source and propagation: exact spheres or parabolic ones (Fresnel).
    """

    diameter_mm: float
    aperture: Aperture = "circle"
    focal_length_mm: float = math.inf
    focus_mm: float = math.inf
    sensor_mm: float | None = None
    lens_phase: Phase = "exact"
    kernel: Phase = "exact"

    def __post_init__(self) -> None:
        """Refuse what cannot be built, or is no optics.

        Raises:
            ContractError: If so. An exact lens with a parabolic kernel, as equations (2.8) and
                (2.9) of Sun 2021 have it, is a lens with r^4 / 8 f^3 of spherical aberration:
                0.8 waves and a Strehl ratio of 0.1 for the camera of its chapter 5.
        """
        if self.aperture not in APERTURES:
            raise ContractError(f"an aperture is one of {', '.join(APERTURES)}")
        if self.lens_phase not in PHASES or self.kernel not in PHASES:
            raise ContractError(f"lens_phase and kernel are one of {', '.join(PHASES)}")
        lengths = (self.diameter_mm, self.focal_length_mm, self.focus_mm)
        if not all(length > 0 for length in lengths) or math.isinf(self.diameter_mm):
            raise ContractError(f"lengths must be > 0; got {lengths}")
        has_lens = math.isfinite(self.focal_length_mm)
        if has_lens == (self.sensor_mm is not None):
            raise ContractError("state sensor_mm without a lens, and not with one: it follows")
        if self.sensor_mm is not None and not 0 < self.sensor_mm < math.inf:
            raise ContractError(f"sensor_mm must be > 0; got {self.sensor_mm}")
        if has_lens and self.focus_mm <= self.focal_length_mm:
            raise ContractError("a lens focuses on what is farther away than its focal length")
        if has_lens and self.lens_phase != self.kernel:
            raise ContractError(
                f"an {self.lens_phase} lens phase with a {self.kernel} kernel has spherical "
                "aberration that no lens has: make both exact or both parabolic"
            )

    @property
    def distance_mm(self) -> float:
        """Return the distance from the plate to the sensor."""
        if self.sensor_mm is not None:
            return self.sensor_mm
        return 1 / (1 / self.focal_length_mm - 1 / self.focus_mm)

    def path_mm(self, r2_mm: Tensor, depth_mm: float) -> Tensor:
        """Return path through places of the plate less that through its middle, without a plate.

        Args:
            r2_mm: Squared distances from the axis in mm^2, of any shape such as (cells, cells).
            depth_mm: Of a source on the axis; inf is allowed.

        Returns:
            Path differences in mm, in the shape of `r2_mm`.

        References: Sun 2021, eq. (2.6), (2.8), (2.9), each without the part that is the same
            everywhere.
        """
        source = _longer(r2_mm, depth_mm, self.kernel)
        lens = _longer(r2_mm, self.focal_length_mm, self.lens_phase)
        return source - lens + _longer(r2_mm, self.distance_mm, self.kernel)

    def steepest(self, depth_mm: float) -> float:
        """Return the largest slope of `path_mm` in the aperture, mm per mm."""
        reach = self.diameter_mm / 2 * (math.sqrt(2) if self.aperture == "square" else 1)
        slopes = [
            _slope(radius, depth_mm, self.kernel)
            - _slope(radius, self.focal_length_mm, self.lens_phase)
            + _slope(radius, self.distance_mm, self.kernel)
            for radius in (reach * step / 64 for step in range(65))
        ]
        return max(abs(slope) for slope in slopes)


def _longer(r2_mm: Tensor, distance_mm: float, phase: Phase) -> Tensor:
    """Return the extra length of the way to a point from a place off the axis."""
    if math.isinf(distance_mm):
        return r2_mm * 0
    if phase == "parabolic":
        return r2_mm / (2 * distance_mm)
    # as the difference of two lengths it would lose its digits
    return r2_mm / ((r2_mm + distance_mm**2).sqrt() + distance_mm)


def _slope(radius_mm: float, distance_mm: float, phase: Phase) -> float:
    if math.isinf(distance_mm):
        return 0.0
    length = distance_mm if phase == "parabolic" else math.hypot(radius_mm, distance_mm)
    return radius_mm / length
