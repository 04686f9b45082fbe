"""A lens with several configurations as one problem: shared surfaces, gaps of each state.

    vary -> variables, shared or of one state -> a Problem for each state -> residuals of all

The focal length of every state is kept by a residual: one curvature cannot be solved for several.
The sensor does not ride: the gap in front of it is a variable, of each state where it moves.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.states import plain_lens
from camkit.models_def.optics.paraxial import focal_lengths, paraxial_data
from camkit.models_def.optics.prescription import Lens, Vary
from camkit.models_def.optics.search.improvement import (
    FOCUS_REACH_MM,
    gap_variable,
    refuse_nothing_free,
    surface_variables,
)
from camkit.models_def.optics.search.own_frame import in_own_frame
from camkit.models_def.optics.search.problem import Problem, residuals
from camkit.models_def.optics.search.variables import FreeLens, Variable

EFL_WEIGHT: Final = 30.0
"""Of a relative error of a focal length: as one of distortion beyond its limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointVariable:
    """A free number of a lens with configurations.

    Attributes:
        variable: What is free, and its bounds.
        state: Configuration that the gap is free in, where states differ in it; empty for all.
    """

    variable: Variable
    state: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class StateTerm:
    """One configuration in the merit.

    Attributes:
        name: Of the configuration.
        problem: The lens in it.
        places: (variable,) int64, where its variables stand among all.
        efl_mm: The focal length that it keeps.
        weight: Share of the merit.
    """

    name: str
    problem: Problem
    places: Tensor
    efl_mm: float
    weight: float

    def efl_residuals(self, scaled: Tensor) -> Tensor:
        """Return residuals (start, 1) of a batch (start, variable) of this state."""
        free = self.problem.free
        reference_um = torch.tensor([free.lens.reference_wavelength_um], dtype=torch.float64)
        efl_mm = focal_lengths(free.tensors(scaled, reference_um))[0]
        return (efl_mm.reshape(-1, 1) / self.efl_mm - 1) * EFL_WEIGHT


@dataclass(frozen=True, slots=True, kw_only=True)
class JointProblem:
    """The merit of a lens over several configurations.

    Attributes:
        lens: With its configurations.
        variables: All free numbers.
        terms: The configurations that count.
    """

    lens: Lens
    variables: tuple[JointVariable, ...]
    terms: tuple[StateTerm, ...]

    def scaled(self) -> Tensor:
        """Return the lens itself as scaled variables (variable,), within the bounds."""
        values = torch.zeros(len(self.variables), dtype=torch.float64)
        for term in self.terms:
            values[term.places] = term.problem.free.scaled()
        return values

    def residuals(self, scaled: Tensor) -> Tensor:
        """Return residuals (start, residual) of a batch (start, variable); gradients flow.

        The sum of their squares is the weighted mean of the merits of the states.
        """
        parts = []
        for term in self.terms:
            of_state = scaled[:, term.places]
            every = [residuals(term.problem, of_state), term.efl_residuals(of_state)]
            parts.append(torch.cat(every, dim=1) * term.weight**0.5)
        return torch.cat(parts, dim=1)

    def in_own_frame(self) -> "JointProblem":
        """Return the problem with each state in its own frame, see `in_own_frame`."""
        scaled = self.scaled()
        terms = tuple(
            replace(term, problem=in_own_frame(term.problem, scaled[term.places]))
            for term in self.terms
        )
        return replace(self, terms=terms)

    def lens_at(self, scaled: Tensor) -> Lens:
        """Return one lens (variable,) with its configurations; rims are those of `lens`.

        Configurations that do not count keep their gaps.
        """
        moving = moving_gaps(self.lens)
        lenses = {t.name: t.problem.free.lens_at(scaled[t.places]) for t in self.terms}
        shared = lenses[self.terms[0].name].surfaces
        surfaces = tuple(
            replace(
                new,
                semi_diameter_mm=old.semi_diameter_mm,
                thickness_mm=old.thickness_mm if i in moving else new.thickness_mm,
            )
            for i, (old, new) in enumerate(zip(self.lens.surfaces, shared, strict=True))
        )
        states = tuple(
            replace(
                state,
                thickness_mm=tuple(
                    (i, lenses[state.name].surfaces[i].thickness_mm) for i in sorted(moving)
                ),
            )
            if state.name in lenses
            else state
            for state in self.lens.configurations
        )
        return replace(self.lens, surfaces=surfaces, configurations=states)


def moving_gaps(lens: Lens) -> set[int]:
    """Return the surfaces whose gaps some configuration names."""
    return {i for state in lens.configurations for i, _ in state.thickness_mm}


def joint_problem(
    lens: Lens,
    names: Sequence[str],
    vary: Sequence[Sequence[Vary]],
    problem_of: Callable[[FreeLens], Problem],
    *,
    moves: bool = False,
    weights: Sequence[float] = (),
) -> JointProblem:
    """Free numbers of a lens for several configurations at once.

    A gap that some configuration names is a variable of each state, and any other number is one for
    all. The gap in front of the sensor is always free.

    Args:
        lens: With its configurations.
        names: Of those that count.
        vary: For each surface what is free.
        problem_of: Makes the problem of one state.
        moves: Whether all gaps that configurations name are free too.
        weights: One for each name, > 0; empty for equal ones.

    Raises:
        ContractError: If nothing is free, or the weights do not fit the names.
    """
    moving = moving_gaps(lens)
    if not (any(vary) or (moves and moving)):
        refuse_nothing_free()
    lenses = [plain_lens(lens, name) for name in names]
    variables = [JointVariable(variable=v) for v in _shared(lenses[0], vary, moving)]
    gaps = [i for i in sorted(moving) if moves or "thickness" in vary[i]]
    last = len(lens.surfaces) - 1
    if last in moving and last not in gaps:
        gaps.append(last)
    for name, one in zip(names, lenses, strict=True):
        variables += [JointVariable(variable=gap_variable(one, i), state=name) for i in gaps]
    return joint_of(lens, names, variables, problem_of, weights)


def joint_of(
    lens: Lens,
    names: Sequence[str],
    variables: Sequence[JointVariable],
    problem_of: Callable[[FreeLens], Problem],
    weights: Sequence[float] = (),
) -> JointProblem:
    """Return the problem of given variables; see `joint_problem`.

    Raises:
        ContractError: If the weights do not fit the names, a variable is of another state, or a gap
            that some configuration names is shared.
    """
    shares = list(weights) or [1.0] * len(names)
    if len(shares) != len(names) or not all(0 < share < math.inf for share in shares):
        raise ContractError(
            f"weights are numbers > 0, one for each of {', '.join(names)}; got {shares}"
        )
    moving = moving_gaps(lens)
    for v in variables:
        moves = v.variable.kind == "thickness" and v.variable.surface in moving
        if v.state not in (names if moves else ("",)):
            what = f"the gap behind surface {v.variable.surface}" if moves else v.variable.kind
            places_text = ", ".join(names) if moves else "no configuration: it is shared"
            raise ContractError(f"{what} is free in {places_text}; got {v.state or 'none'!r}")
    terms = []
    for name, share in zip(names, shares, strict=True):
        one = plain_lens(lens, name)
        places = [i for i, v in enumerate(variables) if v.state in ("", name)]
        free = tuple(variables[i].variable for i in places)
        terms.append(
            StateTerm(
                name=name,
                problem=problem_of(FreeLens(lens=one, variables=free, rides=False)),
                places=torch.tensor(places, dtype=torch.int64),
                efl_mm=paraxial_data(one).efl_mm,
                weight=share / sum(shares),
            )
        )
    return JointProblem(lens=lens, variables=tuple(variables), terms=tuple(terms))


def _shared(lens: Lens, vary: Sequence[Sequence[Vary]], moving: set[int]) -> list[Variable]:
    """Return the variables that all states share."""
    variables: list[Variable] = []
    for i, (surface, names) in enumerate(zip(lens.surfaces, vary, strict=True)):
        for name in names:
            if not (name == "thickness" and i in moving):
                variables += surface_variables(lens, surface, i, name, solved=None)
    last, gap_mm = len(lens.surfaces) - 1, lens.surfaces[-1].thickness_mm
    if last not in moving:
        low, high = gap_mm - FOCUS_REACH_MM, gap_mm + FOCUS_REACH_MM
        variables.append(Variable(kind="thickness", surface=last, low=low, high=high))
    return variables
