"""A given lens made better: its free numbers moved by damped least squares."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NoReturn

import numpy as np
import torch
from torch import Tensor

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import VARY, Lens, Surface, Vary
from camkit.models_def.optics.search.least_squares import Residuals, descend
from camkit.models_def.optics.search.problem import Problem, residuals
from camkit.models_def.optics.search.variables import KINDS, FreeLens, Parameter, Variable

CONIC_REACH: Final = 5.0
FOCUS_REACH_MM: Final = 2.0
_LEAST_GLASS_MM: Final = 1.0
_LEAST_AIR_MM: Final = 0.1
_ASPHERE_TERMS: Final = 4
_ASPHERE_SAG_MM: Final = 0.2
_PHASE: Final = 500.0  # radians
_TOUCH: Final = 1e-6
_WIDER_GAP_MM: Final = 5.0
RANGES: Final[Mapping[Parameter, str]] = {
    "curvature": "± the curvature or ± 1 / EFL, the larger. The last refracting surface whose "
    "curvature is free keeps the focal length instead.",
    "conic": f"± {CONIC_REACH:g}. A plane whose curvature is not free has none.",
    "thickness": f"From {_LEAST_AIR_MM:g} mm (air) or {_LEAST_GLASS_MM:g} mm (glass), or the gap "
    f"itself if less, to twice the gap or {_WIDER_GAP_MM:g} mm more, the larger. The last gap is "
    "not among them.",
    "even_asphere": f"± twice the coefficient or ± {_ASPHERE_SAG_MM:g} mm of sag, the larger, for "
    f"r^4 to r^{2 * _ASPHERE_TERMS} and further terms of the file. The sag counts at the rim or at "
    "the diameter of the entrance pupil, the smaller. r^2 stays.",
    "odd_asphere": f"As `even_asphere`, for r^3 to r^{2 * _ASPHERE_TERMS - 1} and further terms of "
    "the file. r stays.",
    "q_asphere": f"± twice the coefficient or ± {_ASPHERE_SAG_MM:g} mm, the larger, for the terms "
    "of the file.",
    "phase": f"± twice the coefficient or ± {_PHASE:g} rad, the larger, for the radial terms of "
    "the file.",
    "defocus": f"± {FOCUS_REACH_MM:g} mm. Always free.",
}
"""The ranges of `surface_variables` about the values of a lens, for people."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Improvement:
    """The result of a search from a given lens.

    Attributes:
        scaled: (variable,), the best.
        ends: (start, variable), where every start that went to the end came to, best first.
        merit_before: Sum of squares of the given lens.
        merit: Of the best.
        merits: Of `ends`.
        evaluations: Lenses traced.
    """

    scaled: Tensor
    ends: Tensor
    merit_before: float
    merit: float
    merits: tuple[float, ...]
    evaluations: int


def free_lens(lens: Lens, vary: Sequence[Sequence[Vary]]) -> FreeLens:
    """Free numbers of a lens within bounds around their present values.

    The focal length is kept by the curvature of the last refracting surface when curvatures are
    free; the sensor rides on the paraxial image, with a defocus of its own.

    Args:
        lens: As it is.
        vary: For each surface what is free; none for a surface that stays.

    Raises:
        ContractError: If nothing is free, or a name is unknown.
    """
    if len(vary) != len(lens.surfaces) or not any(vary):
        refuse_nothing_free()
    solved = _solved_surface(lens, vary)
    variables: list[Variable] = []
    for i, (surface, names) in enumerate(zip(lens.surfaces, vary, strict=True)):
        for name in names:
            variables += surface_variables(lens, surface, i, name, solved=solved)
    variables.append(Variable(kind="defocus", low=-FOCUS_REACH_MM, high=FOCUS_REACH_MM))
    efl_mm = None if solved is None else paraxial_data(lens).efl_mm
    return FreeLens(lens=lens, variables=tuple(variables), solved=solved, efl_mm=efl_mm)


def refuse_nothing_free() -> NoReturn:
    """Refuse a search without variables."""
    raise ContractError(
        "nothing of the lens is free: name numbers by `vary` of a surface, or "
        f"{option_text('vary')} {','.join(VARY)}"
    )


def refracting_surfaces(lens: Lens) -> tuple[int, ...]:
    """Return the surfaces between different media; a stop in air is none."""
    media = ["air", *(surface.glass for surface in lens.surfaces)]
    return tuple(i for i, surface in enumerate(lens.surfaces) if media[i] != surface.glass)


def _solved_surface(lens: Lens, vary: Sequence[Sequence[Vary]]) -> int | None:
    free = [i for i in refracting_surfaces(lens) if "curvature" in vary[i]]
    return free[-1] if free else None


def surface_variables(
    lens: Lens, surface: Surface, i: int, name: Vary, *, solved: int | None
) -> list[Variable]:
    """Return the variables of a surface that a name of `vary` frees, with bounds.

    Args:
        lens: As it is.
        surface: Of it.
        i: Its number; the gap of the last one is none of them.
        name: What is free.
        solved: The surface whose curvature is solved for.
    """
    if name == "curvature":
        if i == solved:
            return []
        c = surface.curvature_per_mm
        reach = max(abs(c), 1 / abs(paraxial_data(lens).efl_mm))
        return [_variable_near("curvature", i, c, reach)]
    if name == "conic":
        return [_variable_near("conic", i, surface.conic, CONIC_REACH)]
    if name == "thickness":
        if i == len(lens.surfaces) - 1:
            return []
        return [gap_variable(lens, i)]
    if name == "phase":
        radial = surface.phase.radial_rad if surface.phase else ()
        return _coefficient_variables(name, i, radial, _PHASE)
    if name == "q_asphere":
        return _coefficient_variables(name, i, surface.q_bfs or surface.q_con, _ASPHERE_SAG_MM)
    return [] if surface.asphere.q_kind else _asphere_variables(lens, surface, i, name)


def gap_variable(lens: Lens, i: int) -> Variable:
    """Return the gap behind a surface as a variable: up to twice, at least 5 mm more."""
    surface = lens.surfaces[i]
    gap_mm = surface.thickness_mm
    least = _LEAST_AIR_MM if surface.glass == "air" else _LEAST_GLASS_MM
    most = max(2 * gap_mm, gap_mm + _WIDER_GAP_MM)
    return Variable(kind="thickness", surface=i, low=min(least, gap_mm), high=most)


def _asphere_variables(
    lens: Lens, surface: Surface, i: int, name: Literal["even_asphere", "odd_asphere"]
) -> list[Variable]:
    """Free r^3 or r^4 and higher; the r^2 term is a curvature, a cone has none: they stay."""
    radius_mm = min(surface.semi_diameter_mm, paraxial_data(lens).entrance_pupil_diameter_mm)
    radius_mm /= surface.normal_radius_mm or 1.0
    coefficients = surface.even_asphere if name == "even_asphere" else surface.odd_asphere
    first = 2 if name == "even_asphere" else 1
    variables = []
    for term in range(1, max(_ASPHERE_TERMS, len(coefficients))):
        coefficient = coefficients[term] if term < len(coefficients) else 0.0
        reach = max(2 * abs(coefficient), _ASPHERE_SAG_MM / radius_mm ** (2 * term + first))
        variables.append(_variable_near(name, i, coefficient, reach, term=term))
    return variables


def _coefficient_variables(
    name: Parameter, i: int, coefficients: Sequence[float], reach: float
) -> list[Variable]:
    return [
        _variable_near(name, i, value, max(2 * abs(value), reach), term=term)
        for term, value in enumerate(coefficients)
    ]


def _variable_near(
    parameter: Parameter, i: int, value: float, reach: float, *, term: int = 0
) -> Variable:
    return Variable(kind=parameter, surface=i, term=term, low=value - reach, high=value + reach)


def on_limits(variables: Sequence[Variable], scaled: Tensor) -> tuple[str, ...]:
    """Return the variables that stand on a limit of their range, with their values, for people.

    Args:
        variables: Free ones.
        scaled: (variable,), 0 at the lower limit and 1 at the upper.
    """
    at_low, at_high = (scaled <= _TOUCH).tolist(), (scaled >= 1 - _TOUCH).tolist()
    return tuple(
        f"{_variable_name(one)} = {one.low if low else one.high:.4g}{_unit_text(one)}"
        for one, low, high in zip(variables, at_low, at_high, strict=True)
        if (low or high) and one.low < one.high
    )


def _unit_text(one: Variable) -> str:
    """Return a space and the unit; none where that depends on the term."""
    unit = KINDS[one.kind][0]
    return f" {unit}" if unit and "term" not in unit else ""


def _variable_name(one: Variable) -> str:
    if one.kind == "defocus":
        return one.kind
    term = f" term {one.term}" if one.kind not in ("curvature", "conic", "thickness") else ""
    return f"{one.kind}{term} of surface {one.surface}"


def improve(
    merit: Residuals | Problem,
    begin: Tensor,
    *,
    starts: int = 8,
    spread: float = 0.05,
    anywhere: float = 0.0,
    scout_steps: int = 5,
    steps: int = 60,
    seed: int = 1,
) -> Improvement:
    """Improve one lens; the best of several starts near it goes to the end.

    Args:
        merit: A problem, or residuals of scaled variables.
        begin: (variable,), the lens; it is one of the starts, so the result is never worse.
        starts: How many.
        spread: Half-width of the draws about `begin`, as a share of the bounds.
        anywhere: Share of the starts that are drawn from the whole bounds instead.
        scout_steps: Steps of each start.
        steps: Steps of the best quarter.
        seed: Of the draws.
    """
    function = _function(merit)
    rng = np.random.default_rng(seed)
    near = rng.uniform(-spread, spread, (max(starts, 1), len(begin)))
    near[0] = 0
    starts_scaled = (begin + torch.from_numpy(near)).clamp(0, 1)
    free = min(round(anywhere * len(near)), len(near) - 1)
    starts_scaled[len(near) - free :] = torch.from_numpy(rng.uniform(0, 1, (free, len(begin))))
    fixed = torch.zeros(len(begin), dtype=torch.bool)
    scouted = descend(function, starts_scaled, scout_steps, fixed)
    best_scaled = torch.cat([begin[None], scouted.scaled[: max(1, starts // 4)]])
    descent = descend(function, best_scaled, steps, fixed)
    with torch.no_grad():
        begin_merit = float((function(begin[None]) ** 2).sum())
    merits = tuple(descent.merits.tolist())
    return Improvement(
        scaled=descent.scaled[0],
        ends=descent.scaled,
        merit_before=begin_merit,
        merit=merits[0],
        merits=merits,
        evaluations=scouted.evaluations + descent.evaluations,
    )


def _function(merit: Residuals | Problem) -> Residuals:
    if isinstance(merit, Problem):
        problem = merit
        return lambda scaled: residuals(problem, scaled)
    return merit
