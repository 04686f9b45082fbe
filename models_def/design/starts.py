"""Starts of a joint design: the lens as given, or the best of many starts.

A joint design descends from its start, and its pictures carry little information about a lens whose
rays are lost. Damped least squares on spots costs a fraction of a second a start, handles stiff and
soft numbers alike, and keeps the limits. So several lenses near the given one, or from all over the
bounds, are improved by it first. The best spots are not the best recovered picture, so the design's
own front end may judge the lenses with the best spots; the winner goes into the loop.

With `library` the search begins at the lenses that camkit ships as well (`library`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.design.library import Start, library_of, rank_starts
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.improvement import Improvement, improve
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.spot_residuals import MERITS, Merit
from camkit.models_def.optics.search.variables import FreeLens
from camkit.models_def.toml_table import check_least

T = TypeVar("T")

_PUPIL_RAYS = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Starts:
    """The search for the start of a design.

    Attributes:
        count: Lenses that are tried, the given one among them; 0 begins at it as it is.
        spread: Half-width of the draws about the given lens, as a share of each number's range,
            0 to 1.
        anywhere: Share of the lenses that are drawn from the whole ranges instead, 0 to 1.
        merit: Merit of the spots. `rms`: mean r^2. `sum_abs`: about the mean radius, which
            recovery prefers. `energy`: light outside `core_um`.
        core_um: Radius below which a spot counts as sharp; 0 for the pixel pitch.
        judged: Number of lenses with the best spots that the recovery judges, 2 to a quarter of
            `count` and 1; 0: spots decide. It needs a fixed `kernel_px`.
        scout_steps: Steps of damped least squares for each lens.
        dls_steps: Further steps for the best quarter.
        seed: Random seed of the draws.
        depth_mm: Only depth that the search looks at, at the lens without phases: a plate blurs
            for all depths what is sharp at one. 0: it looks at all that the design looks at.
        library: The search begins at the built-in lenses too, scaled to the recipe.
        library_lenses: Number of built-in lenses that go on, those with the best spots; they
            share `count`.
        elements: Number of elements of these lenses, cemented ones counted one by one; 0 for any.
    """

    count: int = 0
    spread: float = 0.1
    anywhere: float = 0.0
    merit: Merit = "sum_abs"
    core_um: float = 0.0
    judged: int = 0
    scout_steps: int = 5
    dls_steps: int = 20
    seed: int = 1
    depth_mm: float = 0.0
    library: bool = False
    library_lenses: int = 4
    elements: int = 0

    def __post_init__(self) -> None:
        check_least(self, 0, "count", "scout_steps", "dls_steps", "judged", "elements")
        check_least(self, 0, "core_um", "depth_mm", "spread", "anywhere")
        check_least(self, 1, "library_lenses")
        for name in ("spread", "anywhere"):
            if getattr(self, name) > 1:
                raise ContractError(f"{name} must lie in 0..1; got {getattr(self, name)}")
        if self.merit not in MERITS:
            raise ContractError(f"starts.merit is one of {', '.join(MERITS)}; got {self.merit!r}")
        if self.judged and not 2 <= self.judged <= self.ends:
            raise ContractError(
                f"starts.judged must be 0, or 2 to {self.ends} with a count of {self.count}: a "
                f"quarter of them and the given lens go to the end; got {self.judged}"
            )

    @property
    def searches(self) -> bool:
        """Return whether more than the given lens is looked at."""
        return self.library or self.count > 0

    @property
    def ends(self) -> int:
        """Return the number of descents that are finished."""
        if self.library:
            return self.library_lenses * (max(1, self.count // self.library_lenses // 4) + 1)
        return max(1, self.count // 4) + 1 if self.count else 0


def best_starts(problem: Problem, starts: Starts) -> Tensor:
    """Return the lenses (start, variable), scaled, that a design may begin at, best spots first.

    Args:
        problem: Its lens is the given one.
        starts: How many are tried. The best comes back; where the recovery judges, so many and
            the given one.

    Raises:
        ContractError: If no start has finite spots.
    """
    begin = problem.free.scaled()
    if starts.count == 0:
        return begin[None]
    looked, is_sought = _search_of(problem, starts), torch.ones(len(begin), dtype=torch.bool)
    if starts.depth_mm:
        free = _without_phases(problem.free)
        looked = replace(looked, free=free)
        is_sought = torch.tensor([v in free.variables for v in problem.free.variables])
    search = _improved(looked, begin[is_sought], starts, starts.count)
    if not np.isfinite(search.merit):
        raise ContractError(
            f"none of {starts.count} starts near {problem.free.lens.name} forms an image; give "
            "another lens to start from, or tighter bounds"
        )
    ends = search.ends[np.isfinite(search.merits)]
    formed = begin.repeat(len(ends), 1)
    formed[:, is_sought] = ends
    return formed[:1] if not starts.judged else torch.cat([formed[: starts.judged], begin[None]])


def _without_phases(free: FreeLens) -> FreeLens:
    surfaces = tuple(replace(surface, phase=None) for surface in free.lens.surfaces)
    variables = tuple(v for v in free.variables if v.kind != "phase")
    return replace(free, lens=replace(free.lens, surfaces=surfaces), variables=variables)


def _search_of(problem: Problem, starts: Starts) -> Problem:
    """Return the problem with the rays and the merit of the search for a start."""
    return replace(
        problem,
        samples=half_disc(_PUPIL_RAYS),
        merit=starts.merit,
        core_mm=starts.core_um / 1000 or problem.core_mm,
        object_distances_mm=(starts.depth_mm,) if starts.depth_mm else problem.object_distances_mm,
    )


def _improved(search: Problem, begin: Tensor, starts: Starts, count: int) -> Improvement:
    return improve(
        search,
        begin,
        starts=count,
        spread=starts.spread,
        anywhere=starts.anywhere,
        scout_steps=starts.scout_steps,
        steps=starts.dls_steps,
        seed=starts.seed,
    )


def library_starts(
    problem: Problem, starts: Starts, *, omit: Sequence[str] = ()
) -> tuple[Start, ...]:
    """Return the starts that a search of the library found, best spots first.

    Args:
        problem: Of the recipe; its lens is one of the library where it has the wanted elements.
        starts: How many are kept, and improved as a given lens is. The best comes back; where the
            recovery judges, so many, and the lens of the recipe.
        omit: Names of built-in lenses that are not looked at.

    Raises:
        ContractError: If no lens can serve, none has finite spots, or the recipe adds a phase.
    """
    if any(surface.phase for surface in problem.free.lens.surfaces):
        raise ContractError("the library has no lens with a phase: search without starts.library")
    library = library_of(problem, starts.elements, omit=omit)
    search = _search_of(problem, starts)
    best = rank_starts(library.starts, search, starts.scout_steps)[: starts.library_lenses]
    if not best:
        reasons = "; ".join(f"{name} {reason}" for name, reason in library.left_out.items())
        raise ContractError(
            f"no built-in lens serves as a start ({reasons}); search from the lens of the recipe"
        )
    ends: list[Start] = []
    for start in best:
        one = replace(search, free=start.problem.free)
        search_ends = _improved(one, start.scaled, starts, max(1, starts.count // len(best)))
        ends += [
            replace(start, scaled=scaled, merit=merit)
            for scaled, merit in zip(search_ends.ends, search_ends.merits, strict=True)
        ]
    ends.sort(key=lambda start: start.merit)
    origins = [start for start in library.starts if not start.name]
    return tuple(ends[: starts.judged] + origins if starts.judged else ends[:1])


def found_starts(problem: Problem, starts: Starts) -> tuple[Start, ...]:
    """Return the starts of a design, best spots first: of the library, or near the given lens."""
    if starts.library:
        return library_starts(problem, starts)
    lenses = best_starts(problem, starts)
    return tuple(Start(name="", problem=problem, scaled=scaled) for scaled in lenses)


def best_judged(starts: Sequence[T], judge: Callable[[T], float]) -> T:
    """Return the start with the best score of a judge."""
    if len(starts) == 1:
        return starts[0]
    marks = [judge(start) for start in starts]
    return starts[int(np.nanargmax(marks))]
