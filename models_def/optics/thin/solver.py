"""Profiles, distance of the sensor and virtual apertures that make the spots of skew rays small.

Damped least squares of the places where the rays of each virtual aperture land, about their mean:
heights of image points are the means, so they need no search. The focal length is kept by the
curvature of one face.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.least_squares import descend
from camkit.models_def.optics.thin.partition import VirtualApertures, partitioned_phase
from camkit.models_def.optics.thin.skew import PlateNumbers, trace_plate
from camkit.models_def.optics.thin.thin_recipe import Faces, PlateTable, ThinRecipe
from camkit.units import UM_PER_MM, to_mm

# ranges of the search: what a term may move the rim, curvature terms, sensor
_TERM_MM: Final = 2.0
_BEND_PER_MM: Final = 0.02
_FOCUS_MM: Final = 3.0
# of rays that are lost, so that a step into nonsense is refused
_LOST_MM: Final = 10.0
# where the discs lie at first: as a stop so far in front of the plate cuts them out
_STOP_MM: Final = 15.0
_INSIDE: Final = 0.98
_LEAST_ROOM_MM: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedPlate:
    """The result of the solver.

    Attributes:
        front: Terms r^2, r^4, ... of the front profile; empty for a plane.
        back: The same of the back profile.
        bfl_mm: From the back face to the sensor.
        apertures: The virtual apertures.
        heights_mm: (direction,), of the image points.
        spot_rms_um: (direction,), of the rays of the virtual apertures.
    """

    front: tuple[float, ...]
    back: tuple[float, ...]
    bfl_mm: float
    apertures: VirtualApertures
    heights_mm: tuple[float, ...]
    spot_rms_um: tuple[float, ...]


def back_radius_mm(plate: PlateTable, corner_rad: float) -> float:
    """Return the radius at which unbent light of the corner meets the back face."""
    inside = math.tan(math.asin(math.sin(corner_rad) / plate.index))
    return plate.aperture_mm / 2 + plate.thickness_mm * inside


@dataclass(frozen=True, slots=True)
class _Search:
    """The numbers (start, variable) in 0..1, what they mean, and the spots they give."""

    recipe: ThinRecipe

    @property
    def bends(self) -> int:
        """Number of terms beyond r^2 of a face."""
        return self.recipe.plate.terms - 1

    @property
    def count(self) -> int:
        """Number of unknowns: a curvature, two profiles, centres, the sensor."""
        return 1 + 2 * self.bends + self.recipe.partition.directions

    @property
    def fixed(self) -> Tensor:
        """Numbers that stay: those of a face without a profile."""
        fixed = torch.zeros(self.count, dtype=torch.bool)
        if self.recipe.plate.faces != "both":
            fixed[0] = True
            first = 1 + (self.bends if self.recipe.plate.faces == "front" else 0)
            fixed[first : first + self.bends] = True
        return fixed

    def scales(self) -> Tensor:
        """Return the step of each number that a scaled 1/2 stands for."""
        plate, partition = self.recipe.plate, self.recipe.partition
        rims = (plate.aperture_mm / 2, back_radius_mm(plate, partition.field_angles_rad[-1]))
        powers = range(2, plate.terms + 1)
        terms = [_TERM_MM / rim ** (2 * j) for rim in rims for j in powers]
        room_mm = plate.aperture_mm / 2 - partition.radius_mm
        rest = [room_mm] * (partition.directions - 1) + [_FOCUS_MM]
        return torch.tensor([_BEND_PER_MM, *terms, *rest], dtype=torch.float64)

    def plate_numbers(self, scaled: Tensor) -> tuple[PlateNumbers, Tensor]:
        """Return the plates (plate, 1, 1) and the centres (plate, direction) of their apertures."""
        plate = self.recipe.plate
        values = (2 * scaled - 1) * self.scales()
        bend, front, back, centres, focus = torch.split(
            values, [1, self.bends, self.bends, self.recipe.partition.directions - 1, 1], dim=1
        )
        front_mm, back_mm = self._curvatures(bend[:, 0])
        # EFL less the way from the rear principal plane to the back face
        power = 2 * (plate.index - 1) * front_mm
        bfl = plate.efl_mm * (1 - plate.thickness_mm / plate.index * power)

        def shaped(value: Tensor) -> Tensor:
            return value[:, None, None]

        numbers = PlateNumbers(
            front=[shaped(a) for a in (front_mm, *front.unbind(1))],
            back=[shaped(a) for a in (back_mm, *back.unbind(1))],
            bfl_mm=shaped(bfl + focus[:, 0]),
        )
        return numbers, torch.cat([torch.zeros_like(bend), centres], dim=1)

    def _curvatures(self, back: Tensor) -> tuple[Tensor, Tensor]:
        """Return the r^2 terms of both faces that keep the focal length."""
        plate = self.recipe.plate
        excess, power = plate.index - 1, 1 / plate.efl_mm
        if plate.faces == "back":
            return torch.zeros_like(back), torch.full_like(back, -power / (2 * excess))
        back_curvature = -2 * excess * back
        ahead = (power - back_curvature) / (1 - plate.thickness_mm / plate.index * back_curvature)
        return ahead / (2 * excess), back

    def landings(self, scaled: Tensor) -> tuple[Tensor, Tensor]:
        """Return x and y (plate, direction, ray) on the sensor."""
        plate, partition = self.recipe.plate, self.recipe.partition
        numbers, centres = self.plate_numbers(scaled)
        disc = half_disc(self.recipe.solver.rays)
        x = disc.x * partition.radius_mm + torch.zeros_like(centres)[..., None]
        y = disc.y * partition.radius_mm + centres[..., None]
        slope = torch.tan(torch.tensor(partition.field_angles_rad, dtype=torch.float64))
        gap_mm = plate.thickness_mm - to_mm(plate.groove_depth_um) * (plate.faces == "both")
        return trace_plate(numbers, plate.index, gap_mm, (x, y), slope[:, None])

    def residuals(self, scaled: Tensor) -> Tensor:
        """Return distances from the mean, whose squares sum to mean squares of spots in mm^2."""
        x, y = self.landings(scaled)
        y = y - y.mean(-1, keepdim=True)
        weights = self.recipe.partition.weights or (1.0,) * x.shape[1]
        share = torch.tensor(weights, dtype=torch.float64)[:, None] / x.shape[-1]
        both = torch.cat([x, y], dim=-1) * torch.sqrt(share)
        return torch.nan_to_num(both, nan=_LOST_MM).flatten(1)

    def starts(self) -> Tensor:
        """Return (2, variable): all power in the curvatures, and the profile of eq. (3.4)."""
        partition = self.recipe.partition
        begin = torch.full((2, self.count), 0.5, dtype=torch.float64)
        slope = torch.tan(torch.tensor(partition.field_angles_rad, dtype=torch.float64))[1:]
        room_mm = self.recipe.plate.aperture_mm / 2 - partition.radius_mm
        at = slice(1 + 2 * self.bends, -1)
        span = max(room_mm, _LEAST_ROOM_MM)
        begin[:, at] += 0.5 * (slope * _STOP_MM / span).clamp(-_INSIDE, _INSIDE)
        centres = (2 * begin[0, at] - 1) * room_mm
        meridional = self._partitioned([0.0, *centres.tolist()]) / self.scales().clamp_min(1e-300)
        begin[1] += 0.5 * meridional.clamp(-1, 1)
        return torch.where(self.fixed, 0.5, begin)

    def _partitioned(self, centres_mm: list[float]) -> Tensor:
        """Return the bends of the profile of eq. (3.4), on the back face unless it is a plane."""
        plate, partition = self.recipe.plate, self.recipe.partition
        apertures = VirtualApertures(
            field_angles_rad=partition.field_angles_rad,
            centres_mm=tuple(centres_mm),
            radius_mm=partition.radius_mm,
        )
        phase = partitioned_phase(apertures, plate.efl_mm, plate.wavelength_um, plate.terms)
        # glass that is higher at the back delays, at the front hastens
        height = phase * to_mm(plate.wavelength_um) / (2 * math.pi * (plate.index - 1))
        variables = torch.zeros(self.count, dtype=torch.float64)
        front = plate.faces == "front"
        first = 1 if front else 1 + self.bends
        terms = torch.from_numpy(-height if front else height)
        variables[first : first + self.bends] = terms[1:]
        if not front:
            variables[0] = terms[0]
        return variables


def solve_plate(recipe: ThinRecipe) -> SolvedPlate:
    """Solve a plate.

    Raises:
        ContractError: If rays of a virtual aperture are lost in the best plate.
    """
    search = _Search(recipe)
    descent = descend(search.residuals, search.starts(), recipe.solver.steps, search.fixed)
    best = descent.scaled[:1]
    with torch.no_grad():
        (x, y), (numbers, centres) = search.landings(best), search.plate_numbers(best)
    if not bool(torch.isfinite(x + y).all()):
        raise ContractError("no plate was found that passes the light; use a smaller corner_deg")
    heights = y.mean(-1)
    rms = torch.sqrt((x**2 + (y - heights[..., None]) ** 2).mean(-1))

    def terms(values: Sequence[Tensor], faces: tuple[Faces, ...]) -> tuple[float, ...]:
        return tuple(map(float, values)) if recipe.plate.faces in faces else ()

    return SolvedPlate(
        front=terms(numbers.front, ("both", "front")),
        back=terms(numbers.back, ("both", "back")),
        bfl_mm=float(numbers.bfl_mm),
        apertures=VirtualApertures(
            field_angles_rad=recipe.partition.field_angles_rad,
            centres_mm=tuple(centres[0].tolist()),
            radius_mm=recipe.partition.radius_mm,
        ),
        heights_mm=tuple(heights[0].tolist()),
        spot_rms_um=tuple((rms[0] * UM_PER_MM).tolist()),
    )
