"""The free numbers of a lens, and batches of lenses made from them.

A batch is (start, variable) in scaled units: 0 is the lower bound of a variable, 1 the upper. What
is not free keeps the value of the lens. One curvature may be solved for the focal length, and the
sensor may ride on the paraxial image, so that the variables do not undo each other.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import repeat
from typing import Final, Literal, get_args

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import image_distance, trace_paraxial
from camkit.models_def.optics.prescription import Lens, Surface, require_round
from camkit.models_def.optics.shape.polynomial import q_tensor
from camkit.models_def.optics.trace import SurfaceTensors, surface_tensors
from camkit.models_def.optics.tracing.series import Series

Parameter = Literal[
    "curvature",
    "conic",
    "thickness",
    "even_asphere",
    "odd_asphere",
    "q_asphere",
    "phase",
    "defocus",
]
PARAMETERS: Final[tuple[Parameter, ...]] = get_args(Parameter)
_IN_MM: Final = "; in mm on a surface with `normal_radius_mm`."
KINDS: Final[Mapping[Parameter, tuple[str, str]]] = {
    "curvature": ("1/mm", "Curvature of the surface."),
    "conic": ("", "Conic constant; 0 is a sphere."),
    "thickness": ("mm", "Gap after the surface."),
    "even_asphere": ("mm^-(2 term + 1)", "Coefficient of r^(2 term + 2)" + _IN_MM),
    "odd_asphere": ("mm^-(2 term)", "Coefficient of r^(2 term + 1)" + _IN_MM),
    "q_asphere": ("mm", "Coefficient number `term` of `q_bfs` or `q_con`, whichever it has."),
    "phase": ("rad", "Coefficient of the phase: radial ones first, then those in x and y."),
    "defocus": ("mm", "Distance of the sensor from the paraxial image that it follows."),
}
"""Unit and meaning, for people."""
_SERIES: Final = ("even_asphere", "odd_asphere", "q_asphere", "phase")
_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """One free number of a lens.

    A lens whose number lies outside `low` to `high` begins at the bound, with a note.

    Attributes:
        kind: What is free.
        surface: Its surface, from 0; `defocus` needs none.
        term: Its coefficient, where the kind is a list: 0 is the first one.
        low: Lower bound, in the unit of the kind.
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
            raise ContractError(
                f"low must be <= high, both finite; got low = {self.low:g}, high = {self.high:g}"
            )


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
        require_round(self.lens, "an optimisation", allow_phases=True)
        count, places = len(self.lens.surfaces), set()
        for variable in self.variables:
            place = (variable.kind, variable.surface, variable.term)
            what = f"{variable.kind} of surface {variable.surface}"
            if not 0 <= variable.surface < count:
                raise ContractError(
                    f"{what}: the lens has {count} surfaces, 0..{count - 1}; a variable needs one"
                )
            if place in places:
                raise ContractError(f"{what}, term {variable.term}, is listed twice as free")
            places.add(place)
            self._check_term(variable)
            if variable.kind == "curvature" and variable.surface == self.solved:
                raise ContractError(
                    f"{what} is solved for the focal length (solved_surface): it is not free"
                )
            last = variable.kind == "thickness" and variable.surface == count - 1
            if last and self.rides:
                raise ContractError("the sensor rides on the image: free its defocus instead")
        if (self.solved is None) != (self.efl_mm is None):
            raise ContractError("a solved curvature needs a focal length, and the other way round")

    def _check_term(self, variable: Variable) -> None:
        surface = self.lens.surfaces[variable.surface]
        is_q = surface.asphere.q_kind is not None
        phase_terms = surface.phase.coefficients if surface.phase else ()
        fits = {
            "even_asphere": not is_q,
            "odd_asphere": not is_q,
            "q_asphere": is_q,
            "phase": variable.term < len(phase_terms),
        }
        if not fits.get(variable.kind, True):
            raise ContractError(
                f"surface {variable.surface} has no such term; got {variable.kind}, term "
                f"{variable.term}"
            )

    @property
    def is_round(self) -> bool:
        """Return whether the lens is round and stays so: no phase in x and y, free or not."""
        phases = [surface.phase for surface in self.lens.surfaces]
        radial = [len(phase.radial_rad) if phase else 0 for phase in phases]
        free = (v for v in self.variables if v.kind == "phase")
        return self.lens.is_round and all(v.term < radial[v.surface] for v in free)

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
        flat = self._flat()
        values = torch.stack([flat[self._place(v)] for v in self.variables])
        return ((values - self.low) / span).clamp(0, 1)

    def outside(self) -> tuple[tuple[Variable, float], ...]:
        """Return variables whose value in the lens lies outside their bounds, with the value."""
        flat = self._flat()
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
        numbers = self._numbers(scaled)
        count = len(self.lens.surfaces)
        base = surface_tensors(self.lens, wavelengths_um)
        reference = self._reference()
        odd, phase = numbers["odd_asphere"], numbers["phase"]
        lens_tensors = SurfaceTensors(
            curvature_per_mm=numbers["curvature"][:, 0],
            conic=numbers["conic"][:, 0],
            even_asphere=self._even(numbers),
            thickness_mm=numbers["thickness"][:, 0],
            semi_diameter_mm=torch.full((count, 1), torch.inf, dtype=torch.float64),
            index=reference.index,
            aspheric=self._aspheric(),
            grooves=base.grooves,
            odd_asphere=odd if odd.shape[1] else None,
            series=self._series(),
            phase=phase if phase.shape[1] else None,
            order_mm=reference.order_mm,
            phases=base.phases,
        )
        lens_tensors = self._solve(lens_tensors, numbers["defocus"][0, 0])

        def shaped(value: Tensor) -> Tensor:
            return value[..., None, None, None]

        odd_asphere, orders = lens_tensors.odd_asphere, base.order_mm
        return replace(
            lens_tensors,
            curvature_per_mm=shaped(lens_tensors.curvature_per_mm),
            conic=shaped(lens_tensors.conic),
            even_asphere=shaped(lens_tensors.even_asphere),
            thickness_mm=shaped(lens_tensors.thickness_mm),
            semi_diameter_mm=shaped(lens_tensors.semi_diameter_mm),
            index=base.index[..., None],
            odd_asphere=None if odd_asphere is None else shaped(odd_asphere),
            phase=None if lens_tensors.phase is None else shaped(lens_tensors.phase),
            order_mm=None if orders is None else orders[..., None],
        )

    def _numbers(self, scaled: Tensor) -> dict[str, Tensor]:
        """Return all numbers of each kind (surface, term, start); the defocus is (1, 1, start)."""
        places = torch.tensor([self._place(v) for v in self.variables], dtype=torch.int64)
        values = self.low + scaled * (self.high - self.low)
        rows = self._flat().repeat(len(scaled), 1).index_copy(1, places, values).T
        shapes = self._shapes()
        parts = torch.split(rows, [math.prod(shape) for shape in shapes.values()])
        return {
            kind: part.reshape(*shape, len(scaled))
            for (kind, shape), part in zip(shapes.items(), parts, strict=True)
        }

    def _even(self, numbers: dict[str, Tensor]) -> Tensor:
        """Return the even coefficients (surface, term, start), those of Q aspheres as powers."""
        even, q = numbers["even_asphere"], numbers["q_asphere"]
        if not q.shape[1]:
            return even
        spare = max(0, q.shape[1] + 1 - even.shape[1])
        even = torch.nn.functional.pad(even, (0, 0, 0, spare))
        rows = []
        for row, terms, surface in zip(even, q, self.lens.surfaces, strict=True):
            kind = surface.asphere.q_kind
            if kind is None:
                rows.append(row)
                continue
            powers = q_tensor(kind, len(terms)) @ terms
            rows.append(torch.nn.functional.pad(powers, (0, 0, 0, len(row) - len(powers))))
        return torch.stack(rows)

    def lens_at(self, scaled: Tensor) -> Lens:
        """Return one lens (variable,) as a prescription; semi-diameters are those of `lens`."""
        wave = torch.tensor([self.lens.reference_wavelength_um], dtype=torch.float64)
        tensors, numbers = self.tensors(scaled.detach()[None], wave), self._numbers(scaled[None])
        surfaces = tuple(
            self._surface(surface, tensors, numbers, i)
            for i, surface in enumerate(self.lens.surfaces)
        )
        return replace(self.lens, surfaces=surfaces)

    def _surface(
        self, surface: Surface, tensors: SurfaceTensors, numbers: dict[str, Tensor], i: int
    ) -> Surface:
        def terms(kind: str) -> tuple[float, ...]:
            values = numbers[kind][i].flatten().tolist()
            while values and values[-1] == 0:
                values.pop()
            return tuple(values)

        changed = replace(
            surface,
            curvature_per_mm=float(tensors.curvature_per_mm[i]),
            conic=float(tensors.conic[i]),
            thickness_mm=float(tensors.thickness_mm[i]),
            even_asphere=terms("even_asphere"),
            odd_asphere=terms("odd_asphere"),
        )
        if surface.phase is not None:
            phase = surface.phase.with_coefficients(numbers["phase"][i].flatten().tolist())
            changed = replace(changed, phase=phase)
        kind = surface.asphere.q_kind
        # a Q asphere whose terms all came to 0 keeps its kind
        q_terms = terms("q_asphere") or (0.0,)
        if kind == "bfs":
            return replace(changed, q_bfs=q_terms)
        return changed if kind is None else replace(changed, q_con=q_terms)

    def _shapes(self) -> dict[str, tuple[int, int]]:
        """Return how many surfaces and terms each kind of number has, in the order of a row."""
        count = len(self.lens.surfaces)
        shapes = dict.fromkeys(("curvature", "conic", "thickness"), (count, 1))
        for kind in _SERIES:
            lengths = [len(_terms_of(surface, kind)) for surface in self.lens.surfaces]
            free = [v.term + 1 for v in self.variables if v.kind == kind]
            shapes[kind] = (count, max([*lengths, *free]))
        return {**shapes, "defocus": (1, 1)}

    def _flat(self) -> Tensor:
        """Return all numbers of the lens in one row, in the order of `_shapes`."""
        surfaces = self.lens.surfaces
        row = [s.curvature_per_mm for s in surfaces]
        row += [s.conic for s in surfaces]
        row += [s.thickness_mm for s in surfaces]
        shapes = self._shapes()
        for kind in _SERIES:
            for s in surfaces:
                terms = _terms_of(s, kind)
                row += [*terms, *[0.0] * (shapes[kind][1] - len(terms))]
        flat = torch.tensor([*row, 0.0], dtype=torch.float64)
        if self.rides:
            flat[-1] = row[3 * len(surfaces) - 1] - self._riding_distance_mm()
        return flat

    def _riding_distance_mm(self) -> float:
        """Return the paraxial image distance of the lens as it stands."""
        wave = torch.tensor(self.lens.reference_wavelength_um, dtype=torch.float64)
        tensors = surface_tensors(self.lens, wave)
        return float(image_distance(tensors, self.lens.object_distance_mm))

    def _place(self, variable: Variable) -> int:
        start = 0
        for kind, (count, terms) in self._shapes().items():
            if kind == variable.kind:
                return start + (variable.surface * terms + variable.term if count > 1 else 0)
            start += count * terms
        raise ContractError(f"unknown kind of variable {variable.kind}")

    def _aspheric(self) -> tuple[bool, ...]:
        free = {v.surface for v in self.variables if v.kind == "even_asphere"}
        shapes = zip(self.lens.surfaces, self._series() or repeat(None), strict=False)
        return tuple(
            i in free or any(s.even_asphere) or s.grooves is not None or series is not None
            for i, (s, series) in enumerate(shapes)
        )

    def _series(self) -> tuple[Series | None, ...]:
        """Return the static part of polynomials, with odd terms where those are free."""
        free = {v.surface for v in self.variables if v.kind == "odd_asphere"}
        rows = [
            replace(s.polynomial.series or Series(), odd=True) if i in free else s.polynomial.series
            for i, s in enumerate(self.lens.surfaces)
        ]
        return tuple(rows) if any(rows) else ()

    def _reference(self) -> SurfaceTensors:
        wave = torch.tensor([self.lens.reference_wavelength_um], dtype=torch.float64)
        return surface_tensors(self.lens, wave)

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


def _terms_of(surface: Surface, kind: str) -> tuple[float, ...]:
    if kind == "phase":
        return surface.phase.coefficients if surface.phase else ()
    if kind == "q_asphere":
        return surface.q_bfs or surface.q_con
    return surface.even_asphere if kind == "even_asphere" else surface.odd_asphere


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
