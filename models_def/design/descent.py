"""The descent of a lens on the error that the bank is expected to leave."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.design.expected import Descent, ExpectedError, even_mean
from camkit.models_def.design.fabrication import draw_copy
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.design.shipped_camera import Camera
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors
from camkit.progress import counted

COPY_SEED: Final = 990_000
_HISTORY: Final = 20

MakeLens = Callable[[Tensor], DesignLens]
"""Scaled numbers (variable,) -> a lens that begins there, its moves whitened there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Descending:
    """The parts of a descent.

    Attributes:
        descent: How.
        camera: Whose bank is expected to restore.
        fabrication: Errors of Monte-Carlo samples.
        make: Of lenses.
        seed: Of samples and starts.
    """

    descent: Descent
    camera: Camera
    fabrication: FabricationErrors
    make: MakeLens
    seed: int

    def error_of(self, lens: DesignLens) -> ExpectedError:
        """Return the merit with the samples of the seed."""
        first = COPY_SEED + 1000 * self.seed
        nominal = lens.problem.free.lens
        numbers = range(first, first + self.descent.copies)
        copies = [draw_copy(nominal, self.fabrication, number) for number in numbers]
        return ExpectedError(self.camera, self.descent, copies)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Goal:
    """The loss of a lens: gains over the lens at the start (iso, depth, field), and limits."""

    error: ExpectedError
    begin_db: Tensor
    descent: Descent

    def loss(self, lens: DesignLens) -> Tensor:
        every_db, penalty = self.error(lens)
        gain = even_mean(every_db - self.begin_db, self.descent.evenness)
        return self.descent.penalty_weight * penalty - gain


def descended(begin: Tensor, parts: Descending) -> Tensor:
    """Return the lens (variable,), scaled, at the end of the best descent, or `begin`."""
    descent, draws = parts.descent, torch.Generator().manual_seed(parts.seed)
    lens = parts.make(begin)
    error = parts.error_of(lens)
    with torch.no_grad():
        goal = _Goal(error=error, begin_db=error(lens)[0], descent=descent)
        ends = [(-float(goal.loss(lens)), begin)]
    starts = [begin]
    for _ in range(descent.starts - 1):
        normal = torch.randn(lens.moves.shape, generator=draws, dtype=lens.moves.dtype)
        starts.append(_numbers_at(lens, descent.spread * normal))
    ends += [_descend(parts.make(start), goal) for start in counted(starts, "descending", "lenses")]
    for _ in counted(range(descent.rounds - 1), "descending on", "rounds"):
        ends.append(_descend(parts.make(_best(ends)[1]), goal))
    return _best(ends)[1]


def _best(ends: list[tuple[float, Tensor]]) -> tuple[float, Tensor]:
    return max(ends, key=lambda end: end[0])


def _numbers_at(lens: DesignLens, moves: Tensor) -> Tensor:
    with torch.no_grad():
        lens.moves.copy_(moves)
        return lens.scaled()


def _descend(lens: DesignLens, goal: _Goal) -> tuple[float, Tensor]:
    """Return merit and numbers of the best lens on the way down from one."""
    evaluations = goal.descent.evaluations
    best = (float("-inf"), lens.scaled().detach())
    optimiser = torch.optim.LBFGS(
        [lens.moves],
        max_iter=evaluations,
        max_eval=evaluations,
        history_size=_HISTORY,
        line_search_fn="strong_wolfe",
    )

    def closure() -> Tensor:
        nonlocal best
        optimiser.zero_grad()
        loss = goal.loss(lens)
        loss.backward()  # type: ignore[no-untyped-call]
        best = max(best, (-float(loss.detach()), lens.scaled().detach()), key=lambda end: end[0])
        return loss

    optimiser.step(closure)  # type: ignore[no-untyped-call]
    return best
