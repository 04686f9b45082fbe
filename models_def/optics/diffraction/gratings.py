"""Gratings whose streaks are known in closed form: the start of a design, and a plate by itself.

A weak grating sends as much light into its two orders as its phase has variance. Where its
frequency changes over the plate, the orders become streaks: frequency f lands at lambda L f. A
streak is evenly bright if every frequency gets the same area of the aperture.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.heights import GratingMap
from camkit.units import UM_PER_MM


@dataclass(frozen=True, slots=True, kw_only=True)
class Streaks:
    """The streaks that a plate should write, at its design wavelength.

    Attributes:
        angles_rad: (line,), from +x (right) towards +y (down); every line has two arms.
        near_um: Where arms begin, from the middle of the PSF on the sensor.
        far_um: Where they end.
        share: Of the light, in all arms together; below a third, as gratings must be weak.
        wavelength_um: Of the design.
        index: Of the plate there.
    """

    angles_rad: tuple[float, ...]
    near_um: float
    far_um: float
    share: float
    wavelength_um: float
    index: float

    def __post_init__(self) -> None:
        """Refuse streaks that no weak grating writes.

        Raises:
            ContractError: If so.
        """
        if not self.angles_rad or not 0 <= self.near_um < self.far_um:
            raise ContractError(f"streaks need a line, and near_um < far_um; got {self}")
        if not 0 < self.share < 1 / 3:
            raise ContractError(f"share lies between 0 and 1/3; got {self.share}")
        if not (self.wavelength_um > 0 and self.index > 1):
            raise ContractError(f"a wavelength > 0 and an index > 1 are needed; got {self}")

    @property
    def phase_rad(self) -> float:
        """Return the amplitude of the phase of one grating.

        All gratings take light from the core alike: 1 - share = J0(a)^(2 lines).
        """
        bare_share = (1 - self.share) ** (1 / (2 * len(self.angles_rad)))
        low, high = 0.0, 2.4
        for _ in range(60):
            middle = (low + high) / 2
            value = float(torch.special.bessel_j0(torch.tensor(middle, dtype=torch.float64)))
            low, high = (middle, high) if value > bare_share else (low, middle)
        return low


def chirped_gratings(streaks: Streaks, bench: Bench, cells: int) -> GratingMap:
    """Return the map of gratings that writes streaks.

    Args:
        streaks: What is wanted.
        bench: Aperture and distance of the sensor.
        cells: Of the plate along a side.

    Raises:
        ContractError: If the cells are too wide for the far end of a streak.
    """
    cell_um = bench.diameter_mm * UM_PER_MM / cells
    finest_um = streaks.wavelength_um * bench.distance_mm * UM_PER_MM / streaks.far_um
    if finest_um < 2 * cell_um:
        raise ContractError(
            f"a streak of {streaks.far_um:.0f} um needs a grating of {finest_um:.1f} um: cells of "
            f"{cell_um:.1f} um are too wide, at most {finest_um / 2:.1f} um"
        )
    return GratingMap(cells, streaks.angles_rad, _profiles(streaks, bench, 8 * cells))


def chirp_along(streaks: Streaks, bench: Bench, angle_rad: float, place_mm: Tensor) -> Tensor:
    """Return the sine (place,) of the chirp that writes a line, of amplitude 1.

    Args:
        streaks: What is wanted.
        bench: Aperture and distance of the sensor.
        angle_rad: Of the line.
        place_mm: (place,) along it, evenly, over the whole aperture.
    """
    share = torch.cumsum(_chord(place_mm / bench.diameter_mm, angle_rad, bench), 0)
    share = share / share[-1]
    sensor_um = streaks.near_um + (streaks.far_um - streaks.near_um) * share
    cycles_per_mm = sensor_um / (streaks.wavelength_um * bench.distance_mm)
    cycles = torch.cumsum(cycles_per_mm, 0) * (place_mm[1] - place_mm[0])
    return torch.sin(2 * math.pi * (cycles - cycles[place_mm.numel() // 2]))


def _profiles(streaks: Streaks, bench: Bench, samples: int) -> Tensor:
    """Return a chirp (line, sample) over the diagonal for every line."""
    diagonal_mm = bench.diameter_mm * math.sqrt(2)
    place_mm = torch.linspace(-0.5, 0.5, samples, dtype=torch.float64) * diagonal_mm
    chirps = [chirp_along(streaks, bench, angle, place_mm) for angle in streaks.angles_rad]
    most_um = streaks.phase_rad * streaks.wavelength_um / (2 * math.pi * (streaks.index - 1))
    return most_um * torch.stack(chirps)


def _chord(place: Tensor, angle_rad: float, bench: Bench) -> Tensor:
    """Return the width of the aperture across a direction, in diameters, at places along it."""
    if bench.aperture == "circle":
        return 2 * (0.25 - place**2).clamp_min(0).sqrt()
    across, along = sorted((abs(math.cos(angle_rad)), abs(math.sin(angle_rad))))
    # a square of side 1 seen from an angle is a trapezium
    top, bottom = (along - across) / 2, (along + across) / 2
    inner = torch.ones_like(place) / along
    slope = ((bottom - place.abs()) / max(bottom - top, 1e-12)).clamp(0, 1)
    return inner * slope
