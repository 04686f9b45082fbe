"""Where a joint design begins: the lens as given, disturbed, or the best of many starts.

A joint design goes downhill from where it begins, and its pictures say little about a lens whose
rays are lost. Damped least squares on spots costs a fraction of a second a start, takes stiff and
soft numbers alike, and keeps the limits: so several lenses near the given one are brought down
first, and the best of them goes into the loop.
"""

from dataclasses import dataclass, replace

import numpy as np
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.improvement import improve
from camkit.models_def.optics.search.problem import Problem

_PUPIL_RAYS = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Starts:
    """How a design finds its start.

    Attributes:
        count: Lenses that are tried, the given one among them; 0 begins at it as it is.
        spread: Half-width of the draws about the given lens, as a share of each number's bounds.
        scout_steps: Steps of damped least squares for each.
        dls_steps: Further steps for the best quarter.
        seed: Of the draws.
    """

    count: int = 0
    spread: float = 0.1
    scout_steps: int = 5
    dls_steps: int = 20
    seed: int = 1

    def __post_init__(self) -> None:
        if min(self.count, self.scout_steps, self.dls_steps) < 0 or not 0 <= self.spread <= 1:
            raise ContractError(f"starts needs counts >= 0 and a spread in 0..1; got {self}")


def best_start(problem: Problem, starts: Starts) -> Tensor:
    """Give the lens (variable,), scaled, that a design begins at.

    Args:
        problem: Its lens is the given one.
        starts: How many are tried.

    Raises:
        ContractError: If no start has finite spots.
    """
    begin = problem.free.scaled()
    if starts.count == 0:
        return begin
    found = improve(
        replace(problem, samples=half_disc(_PUPIL_RAYS)),
        begin,
        starts=starts.count,
        spread=starts.spread,
        scout_steps=starts.scout_steps,
        steps=starts.dls_steps,
        seed=starts.seed,
    )
    if not np.isfinite(found.merit):
        raise ContractError(
            f"none of {starts.count} starts near {problem.free.lens.name} forms an image; give "
            "another lens to start from, or tighter bounds"
        )
    return found.scaled


def disturbed(
    lens: Lens, rng: np.random.Generator, *, curvature_share: float, focus_mm: float
) -> Lens:
    """Give a lens with every curvature and the place of its sensor off by chance.

    Args:
        lens: As it should be.
        rng: Of the draws.
        curvature_share: Each curvature is multiplied by 1 + u, u uniform in +- this.
        focus_mm: The sensor is moved by a length uniform in +- this.
    """
    count = len(lens.surfaces)
    factors = 1 + rng.uniform(-curvature_share, curvature_share, count)
    moved_mm = float(rng.uniform(-focus_mm, focus_mm))
    surfaces = [
        replace(s, curvature_per_mm=s.curvature_per_mm * float(factor))
        for s, factor in zip(lens.surfaces, factors, strict=True)
    ]
    last = surfaces[-1]
    surfaces[-1] = replace(last, thickness_mm=last.thickness_mm + moved_mm)
    return replace(lens, surfaces=tuple(surfaces))
