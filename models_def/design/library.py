"""A library of starts: the lenses that camkit ships, scaled to what a recipe asks.

Each is scaled to the focal length and the F-number, focused, and freed as the recipe frees its own
lens. Lenses that cannot serve are left out with the reason. A few steps of damped least squares
rank the others by the merit of the search; the best ones are improved as a given lens is.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.field import slope_of
from camkit.models_def.optics.lens_file.lens_file import built_in_lenses, find_lens
from camkit.models_def.optics.paraxial import focal_lengths, paraxial_data, with_paraxial_focus
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.scaling import scale_to_efl, with_f_number
from camkit.models_def.optics.search.improvement import refracting_surfaces
from camkit.models_def.optics.search.least_squares import descend
from camkit.models_def.optics.search.problem import Problem, residuals
from camkit.models_def.optics.search.variables import FreeLens, Parameter, Variable
from camkit.models_def.optics.trace import surface_tensors

_NEAR_SHARE: Final = 0.7
_SHAPES: Final = ("conic", "even_asphere")
_SAME: Final = 1e-6
_Group = tuple[Parameter, str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """A lens that a design may begin at.

    Attributes:
        name: Of the built-in lens; empty for the lens that the recipe names.
        problem: The search of the recipe, with this lens in it.
        scaled: (variable,), the lens, or what a search made of it.
        merit: Sum of squares of its residuals; inf before it was asked for.
    """

    name: str
    problem: Problem
    scaled: Tensor
    merit: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Library:
    """The built-in lenses, sorted by whether they can serve a recipe.

    Attributes:
        starts: Those that can, after the lens of the recipe itself.
        left_out: Names of the others, each with the reason.
    """

    starts: tuple[Start, ...]
    left_out: dict[str, str]


def library_of(problem: Problem, elements: int = 0, *, omit: Sequence[str] = ()) -> Library:
    """Return the built-in lenses as starts of a problem.

    Args:
        problem: Its lens states F-number, object and reference wavelength, its variables what is
            free and within which bounds, its fields and limits what a lens must do.
        elements: Wanted number of elements, cemented ones counted one by one; 0 for any.
        omit: Names that are not looked at.
    """
    origin = problem.free
    starts: list[Start] = []
    if elements in (0, _elements(origin.lens)):
        starts.append(Start(name="", problem=problem, scaled=origin.scaled()))
    left_out: dict[str, str] = {}
    for name in (name for name in built_in_lenses() if name not in omit):
        reason = _misfit(problem, find_lens(name), elements)
        if not reason:
            start = library_start(problem, name)
            reason = _short(start) or _twin(start, starts)
        if reason:
            left_out[name] = reason
        else:
            starts.append(start)
    return Library(starts=tuple(starts), left_out=left_out)


def library_start(problem: Problem, name: str) -> Start:
    """Return one built-in lens as a start of a problem.

    Raises:
        ContractError: If there is no such lens, or nothing of it is free.
    """
    origin = problem.free
    fields = tuple(torch.atan(problem.slopes).tolist())
    lens = replace(
        find_lens(name),
        name=name,
        field_angles_rad=fields,
        wavelengths_um=tuple(problem.wavelengths_um.tolist()),
        reference_wavelength_um=origin.lens.reference_wavelength_um,
    )
    lens = scale_to_efl(lens, origin.efl_mm or paraxial_data(origin.lens).efl_mm)
    lens = replace(lens, object_distance_mm=origin.lens.object_distance_mm)
    lens = with_paraxial_focus(with_f_number(lens, _f_number(origin)))
    free = _freed(origin, lens)
    if not free.variables:
        raise ContractError(f"nothing of {name} is free: the recipe frees what it does not have")
    return Start(name=name, problem=replace(problem, free=free), scaled=free.scaled())


def rank_starts(starts: Sequence[Start], search: Problem, steps: int) -> tuple[Start, ...]:
    """Return the starts after a few steps of damped least squares, best merit first.

    Args:
        starts: Of the library. One whose light does not arrive is left out.
        search: Its samples, merit and core size are used for all.
        steps: Of each.
    """
    scouted = [_scouted(start, replace(search, free=start.problem.free), steps) for start in starts]
    arriving = (start for start in scouted if math.isfinite(start.merit))
    return tuple(sorted(arriving, key=lambda start: start.merit))


def _scouted(start: Start, search: Problem, steps: int) -> Start:
    fixed = torch.zeros(len(start.scaled), dtype=torch.bool)
    descent = descend(lambda scaled: residuals(search, scaled), start.scaled[None], steps, fixed)
    return replace(start, scaled=descent.scaled[0], merit=float(descent.merits[0]))


def _misfit(problem: Problem, lens: Lens, elements: int) -> str:
    """Return why a lens cannot serve, before it is scaled; empty if it can."""
    count = _elements(lens)
    if any(surface.grooves for surface in lens.surfaces):
        return "has grooves"
    if elements and count != elements:
        return f"has {count} elements"
    shaped = any(surface.conic or any(surface.even_asphere) for surface in lens.surfaces)
    if shaped and not any(variable.kind in _SHAPES for variable in problem.free.variables):
        return "is aspheric, where no conic and no aspheric term is free"
    widest, corner = slope_of(lens.field_angles_rad[-1]), float(problem.slopes[-1])
    if widest < _NEAR_SHARE * corner:
        return f"is made for {math.degrees(math.atan(widest)):.3g} degrees of half field"
    return ""


def _elements(lens: Lens) -> int:
    return sum(surface.glass != "air" for surface in lens.surfaces)


def _short(start: Start) -> str:
    back_mm = start.problem.free.lens.surfaces[-1].thickness_mm
    if back_mm < _NEAR_SHARE * start.problem.limits.min_bfl_mm:
        return f"has its sensor {back_mm:.3g} mm behind it"
    return ""


def _twin(start: Start, earlier: Sequence[Start]) -> str:
    """Return which of the earlier starts is the same lens: its own F-number does not matter."""
    numbers = _numbers(start)
    for other in earlier:
        there = _numbers(other)
        if len(there) == len(numbers) and all(
            math.isclose(a, b, rel_tol=1e-3, abs_tol=_SAME)
            for a, b in zip(numbers, there, strict=True)
        ):
            return f"is {other.name or 'the lens of the recipe'} once more"
    return ""


def _numbers(start: Start) -> list[float]:
    surfaces = start.problem.free.lens.surfaces
    return [s.curvature_per_mm for s in surfaces] + [s.thickness_mm for s in surfaces[:-1]]


def _f_number(origin: FreeLens) -> float:
    lens, efl_mm = origin.lens, origin.efl_mm
    if lens.aperture_kind == "f_number":
        return lens.aperture_value
    if lens.aperture_kind == "entrance_pupil_diameter_mm" and efl_mm:
        return abs(efl_mm) / lens.aperture_value
    return abs(paraxial_data(lens).f_number)


def _freed(origin: FreeLens, lens: Lens) -> FreeLens:
    """Free of a lens what is free of the given one.

    A lens of the same layout has the same variables. Of another one every curvature, gap and focus
    is free whose kind the recipe frees, within the widest bounds that it has for the kind. It has
    no more aspheric surfaces than the recipe has, or than it brings along.
    """
    if _layout(lens) == _layout(origin.lens):
        return replace(origin, lens=lens)
    solved = _strongest(lens) if origin.solved is not None else None
    bounds = _bounds(origin)
    last = len(lens.surfaces) - 1
    variables: list[Variable] = []
    for i in refracting_surfaces(lens):
        if i != solved:
            variables += _variable(bounds, ("curvature", "", 0), i)
    for i, surface in enumerate(lens.surfaces):
        role = "air" if surface.glass == "air" else "glass"
        variables += _variable(bounds, ("thickness", "last" if i == last else role, 0), i)
    for i in _aspheric_surfaces(origin, lens):
        shapes = [group for group in bounds if group[0] in _SHAPES]
        for group in shapes:
            variables += _variable(bounds, group, i)
    variables += _variable(bounds, ("defocus", "", 0), 0)
    return replace(origin, lens=lens, variables=tuple(variables), solved=solved)


def _layout(lens: Lens) -> tuple[int, tuple[bool, ...]]:
    return lens.stop, tuple(surface.glass == "air" for surface in lens.surfaces)


def _bounds(origin: FreeLens) -> dict[_Group, tuple[float, float]]:
    """Return the widest bounds of every kind of number; gaps of glass and air apart."""
    bounds: dict[_Group, tuple[float, float]] = {}
    for v in origin.variables:
        role = ""
        if v.kind == "thickness":
            role = "air" if origin.lens.surfaces[v.surface].glass == "air" else "glass"
            role = "last" if v.surface == len(origin.lens.surfaces) - 1 else role
        group: _Group = (v.kind, role, v.term)
        low, high = bounds.get(group, (v.low, v.high))
        bounds[group] = (min(low, v.low), max(high, v.high))
    return bounds


def _variable(bounds: dict[_Group, tuple[float, float]], group: _Group, i: int) -> list[Variable]:
    if group not in bounds:
        return []
    low, high = bounds[group]
    return [Variable(kind=group[0], surface=i, term=group[2], low=low, high=high)]


def _aspheric_surfaces(origin: FreeLens, lens: Lens) -> list[int]:
    """Return the surfaces that may be aspheric: those that are, then those far from the stop."""
    count = len({v.surface for v in origin.variables if v.kind in _SHAPES})
    surfaces = lens.surfaces
    shaped = {i for i, s in enumerate(surfaces) if s.conic or any(s.even_asphere)}
    media = ["air", *(surface.glass for surface in surfaces)]
    free_standing = [i for i in refracting_surfaces(lens) if "air" in (media[i], surfaces[i].glass)]
    order = sorted(free_standing, key=lambda i: (i not in shaped, -abs(i - lens.stop)))
    return sorted(order[: max(count, len(shaped))]) if count else []


def _strongest(lens: Lens) -> int:
    """Return the surface whose curvature changes the focal length most."""
    wave = torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    tensors = surface_tensors(lens, wave)
    curvature = tensors.curvature_per_mm.clone().requires_grad_()
    efl = focal_lengths(replace(tensors, curvature_per_mm=curvature))[0]
    (slope,) = torch.autograd.grad(efl.sum(), curvature)
    return int(slope.flatten().abs().argmax())
