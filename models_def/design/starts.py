"""Starts of a joint design: the lens as given, or the best of many starts.

A joint design descends from its start, and its pictures carry little information about a lens whose
rays are lost. Damped least squares on spots costs a fraction of a second a start, handles stiff and
soft numbers alike, and keeps the limits. So several lenses near the given one, or from all over the
bounds, are improved by it first. The best spots are not the best recovered picture, so the design's
own front end may judge the lenses with the best spots; the winner goes into the loop.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.improvement import improve
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.spot_residuals import MERITS, Merit

_PUPIL_RAYS = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Starts:
    """The search for the start of a design.

    Attributes:
        count: Lenses that are tried, the given one among them; 0 begins at it as it is.
        spread: Half-width of the draws about the given lens, as a share of each number's bounds.
        anywhere: Share of the lenses that are drawn from the whole bounds instead.
        merit: Of their spots.
        core_um: The size that the merit compares spots with; 0 for the pixel pitch.
        judged: How many of those with the best spots the recovery judges, at most the quarter
            that goes to the end; 0: spots decide.
        scout_steps: Steps of damped least squares for each.
        dls_steps: Further steps for the best quarter.
        seed: Of the draws.
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

    def __post_init__(self) -> None:
        least = min(self.count, self.scout_steps, self.dls_steps, self.judged, self.core_um)
        if least < 0 or not (0 <= self.spread <= 1 and 0 <= self.anywhere <= 1):
            raise ContractError(
                f"starts needs counts >= 0, core_um >= 0, spread and anywhere in 0..1; got {self}"
            )
        if self.merit not in MERITS:
            raise ContractError(f"starts.merit is one of {', '.join(MERITS)}; got {self.merit!r}")
        if self.judged and not 2 <= self.judged <= self.ends:
            raise ContractError(
                f"starts.judged must be 0, or 2 to {self.ends} with a count of {self.count}: a "
                f"quarter of them and the given lens go to the end; got {self.judged}"
            )

    @property
    def ends(self) -> int:
        """Return the number of descents that are finished."""
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
    search = improve(
        replace(
            problem,
            samples=half_disc(_PUPIL_RAYS),
            merit=starts.merit,
            core_mm=starts.core_um / 1000 or problem.core_mm,
        ),
        begin,
        starts=starts.count,
        spread=starts.spread,
        anywhere=starts.anywhere,
        scout_steps=starts.scout_steps,
        steps=starts.dls_steps,
        seed=starts.seed,
    )
    if not np.isfinite(search.merit):
        raise ContractError(
            f"none of {starts.count} starts near {problem.free.lens.name} forms an image; give "
            "another lens to start from, or tighter bounds"
        )
    formed = search.ends[np.isfinite(search.merits)]
    return formed[:1] if not starts.judged else torch.cat([formed[: starts.judged], begin[None]])


def best_judged(lenses: Tensor, judge: Callable[[Tensor], float]) -> Tensor:
    """Return the lens (variable,) of (start, variable) with the best score of a judge."""
    if len(lenses) == 1:
        return lenses[0]
    marks = [judge(scaled) for scaled in lenses]
    return lenses[int(np.nanargmax(marks))]
