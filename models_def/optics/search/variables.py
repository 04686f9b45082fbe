"""The free numbers of a lens, and batches of lenses made from them.

A batch is (start, variable) in scaled units: 0 is the lower bound of a variable, 1 the upper. What
is not free keeps the value of the lens. One curvature may be solved for the focal length, and the
sensor may ride on the paraxial image, so that the variables do not undo each other.
"""

import math
from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import image_distance, trace_paraxial
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.trace import SurfaceTensors, surface_tensors

Parameter = Literal["curvature", "conic", "thickness", "even_asphere", "defocus"]
PARAMETERS: Final[tuple[Parameter, ...]] = get_args(Parameter)
_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """One free number of a lens.

    Attributes:
        kind: curvature (1/mm), conic, thickness (mm, after the surface), even_asphere
            (coefficient of r^(2 term + 2)), or defocus (mm, of the sensor from where it rides).
        surface: Its surface; not used by defocus.
        term: Of even_asphere: 0 is r^2.
        low: Lower bound.
        high: Upper bound; equal to `low` holds the number there.
    """

    kind: Parameter
    surface: int = 0
    term: int = 0
    low: float
    high: float

    def __post_init__(self) -> None:
        if self.kind not in PARAMETERS:
            raise ContractError(f"a variable is one of {', '.join(PARAMETERS)}; got {self.kind!r}")
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low <= self.high):
            raise ContractError(f"a variable needs bounds low <= high; got {self}")


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeLens:
    """A lens with free numbers.

    Attributes:
        lens: What is not free.
        variables: What is.
        solved: The surface whose curvature keeps `efl_mm`; None solves nothing.
        efl_mm: The focal length to be kept.
        rides: Whether the sensor rides on the paraxial image of the object, plus defocus.
    """

    lens: Lens
    variables: tuple[Variable, ...]
    solved: int | None = None
    efl_mm: float | None = None
    rides: bool = True

    def __post_init__(self) -> None:
        count, places = len(self.lens.surfaces), set()
        for variable in self.variables:
            place = (variable.kind, variable.surface, variable.term)
            if not 0 <= variable.surface < count or place in places:
                raise ContractError(f"a variable needs a surface of its own; got {variable}")
            places.add(place)
            if variable.kind == "curvature" and variable.surface == self.solved:
                raise ContractError(f"the curvature of surface {self.solved} is solved: not free")
            last = variable.kind == "thickness" and variable.surface == count - 1
            if last and self.rides:
                raise ContractError("the sensor rides on the image: free its defocus instead")
        if (self.solved is None) != (self.efl_mm is None):
            raise ContractError("a solved curvature needs a focal length, and the other way round")

    @property
    def low(self) -> Tensor:
        """Return the lower bounds (variable,)."""
        return torch.tensor([v.low for v in self.variables], dtype=torch.float64)

    @property
    def high(self) -> Tensor:
        """Return the upper bounds (variable,)."""
        return torch.tensor([v.high for v in self.variables], dtype=torch.float64)

    def scaled(self) -> Tensor:
        """Return the lens itself as scaled variables (variable,), within the bounds."""
        span = (self.high - self.low).clamp_min(1e-300)
        flat, _ = self._flat()
        values = torch.stack([flat[self._place(v)] for v in self.variables])
        return ((values - self.low) / span).clamp(0, 1)

    def outside(self) -> tuple[tuple[Variable, float], ...]:
        """Return variables whose value in the lens lies outside their bounds, with the value."""
        flat, _ = self._flat()
        values = [(v, float(flat[self._place(v)])) for v in self.variables]
        return tuple(
            (v, value)
            for v, value in values
            if not v.low - _ROUNDING * abs(v.low) <= value <= v.high + _ROUNDING * abs(v.high)
        )

    def tensors(self, scaled: Tensor, wavelengths_um: Tensor) -> SurfaceTensors:
        """Return the lenses as tensors (surface, start, 1, 1, 1), index (surface + 1, wave, 1).

        Args:
            scaled: (start, variable); gradients flow.
            wavelengths_um: (wave,).
        """
        flat, terms = self._flat()
        places = torch.tensor([self._place(v) for v in self.variables], dtype=torch.int64)
        values = self.low + scaled * (self.high - self.low)
        numbers = flat.repeat(len(scaled), 1).index_copy(1, places, values).T
        count = len(self.lens.surfaces)
        curvature, conic, gaps, rest = torch.split(
            numbers, [count, count, count, count * terms + 1]
        )
        base = surface_tensors(self.lens, wavelengths_um)
        lens_tensors = SurfaceTensors(
            curvature_per_mm=curvature,
            conic=conic,
            even_asphere=rest[:-1].reshape(count, terms, len(scaled)),
            thickness_mm=gaps,
            semi_diameter_mm=torch.full((count, 1), torch.inf, dtype=torch.float64),
            index=self._reference_index(),
            aspheric=self._aspheric(),
            grooves=base.grooves,
        )
        lens_tensors = self._solve(lens_tensors, rest[-1])

        def shaped(value: Tensor) -> Tensor:
            return value[..., None, None, None]

        return replace(
            lens_tensors,
            curvature_per_mm=shaped(lens_tensors.curvature_per_mm),
            conic=shaped(lens_tensors.conic),
            even_asphere=shaped(lens_tensors.even_asphere),
            thickness_mm=shaped(lens_tensors.thickness_mm),
            semi_diameter_mm=shaped(lens_tensors.semi_diameter_mm),
            index=base.index[..., None],
        )

    def lens_at(self, scaled: Tensor) -> Lens:
        """Return one lens (variable,) as a prescription; semi-diameters are those of `lens`."""
        wave = torch.tensor([self.lens.reference_wavelength_um], dtype=torch.float64)
        tensors = self.tensors(scaled.detach()[None], wave)
        surfaces = tuple(
            self._surface(surface, tensors, i) for i, surface in enumerate(self.lens.surfaces)
        )
        return replace(self.lens, surfaces=surfaces)

    def _surface(self, surface: Surface, tensors: SurfaceTensors, i: int) -> Surface:
        terms = tuple(float(a) for a in tensors.even_asphere[i].flatten())
        while terms and terms[-1] == 0:
            terms = terms[:-1]
        return replace(
            surface,
            curvature_per_mm=float(tensors.curvature_per_mm[i]),
            conic=float(tensors.conic[i]),
            thickness_mm=float(tensors.thickness_mm[i]),
            even_asphere=terms,
        )

    def _terms(self) -> int:
        terms = max(len(s.even_asphere) for s in self.lens.surfaces)
        free = [v.term + 1 for v in self.variables if v.kind == "even_asphere"]
        return max([terms, *free])

    def _flat(self) -> tuple[Tensor, int]:
        """Return all numbers of the lens in one row: c, k, t of each surface, terms, defocus."""
        surfaces, terms = self.lens.surfaces, self._terms()
        row = [s.curvature_per_mm for s in surfaces]
        row += [s.conic for s in surfaces]
        row += [s.thickness_mm for s in surfaces]
        for s in surfaces:
            row += [*s.even_asphere, *[0.0] * (terms - len(s.even_asphere))]
        flat = torch.tensor([*row, 0.0], dtype=torch.float64)
        if self.rides:
            flat[-1] = row[3 * len(surfaces) - 1] - self._riding_distance_mm()
        return flat, terms

    def _riding_distance_mm(self) -> float:
        """Return the paraxial image distance of the lens as it stands."""
        wave = torch.tensor(self.lens.reference_wavelength_um, dtype=torch.float64)
        tensors = surface_tensors(self.lens, wave)
        return float(image_distance(tensors, self.lens.object_distance_mm))

    def _place(self, variable: Variable) -> int:
        count, i = len(self.lens.surfaces), variable.surface
        terms = self._terms()
        return {
            "curvature": i,
            "conic": count + i,
            "thickness": 2 * count + i,
            "even_asphere": 3 * count + i * terms + variable.term,
            "defocus": 3 * count + count * terms,
        }[variable.kind]

    def _aspheric(self) -> tuple[bool, ...]:
        free = {v.surface for v in self.variables if v.kind == "even_asphere"}
        aspheric = {i for i, s in enumerate(self.lens.surfaces) if any(s.even_asphere) or s.grooves}
        return tuple(i in free | aspheric for i in range(len(self.lens.surfaces)))

    def _reference_index(self) -> Tensor:
        wave = torch.tensor([self.lens.reference_wavelength_um], dtype=torch.float64)
        return surface_tensors(self.lens, wave).index

    def _solve(self, tensors: SurfaceTensors, defocus: Tensor) -> SurfaceTensors:
        """Solve one curvature for the focal length, then let the sensor ride."""
        if self.solved is not None and self.efl_mm is not None:
            curvature = tensors.curvature_per_mm.clone()
            curvature[self.solved] = solve_curvature(tensors, self.solved, self.efl_mm)
            tensors = replace(tensors, curvature_per_mm=curvature)
        gaps = tensors.thickness_mm
        last = gaps[-1] + defocus
        if self.rides:
            last = image_distance(tensors, self.lens.object_distance_mm) + defocus
        return replace(tensors, thickness_mm=torch.cat([gaps[:-1], last[None]]))


def solve_curvature(tensors: SurfaceTensors, surface: int, efl_mm: float) -> Tensor:
    """Return the curvature of one surface that makes the focal length `efl_mm`.

    The slope behind the lens of a parallel ray of height 1 is -1 / efl; it is linear in the power
    of the one surface: u' = -(alpha + beta c).
    """
    count, one = len(tensors.aspheric), torch.ones_like(tensors.curvature_per_mm[0])
    slopes = []
    for trial in (0.0, 1.0):
        curvature = tensors.curvature_per_mm.clone()
        curvature[surface] = trial * one
        trial_tensors = replace(tensors, curvature_per_mm=curvature)
        slopes.append(trace_paraxial(trial_tensors, one, torch.zeros_like(one), range(count))[1])
    return (-1 / efl_mm - slopes[0]) / (slopes[1] - slopes[0])
