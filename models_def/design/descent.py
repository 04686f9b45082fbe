"""The descent of a lens on the error that the bank is expected to leave."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.design.expected import Descent, ExpectedError
from camkit.models_def.design.fabrication import draw_copy
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.design.shipped_camera import Camera
from camkit.models_def.optics.prescription import FabricationErrors
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


def descended(begin: Tensor, parts: Descending) -> Tensor:
    """Return the lens (variable,), scaled, at the end of the best descent, or `begin`."""
    descent, draws = parts.descent, torch.Generator().manual_seed(parts.seed)
    starts = [begin]
    for _ in range(descent.starts - 1):
        lens = parts.make(begin)
        normal = torch.randn(lens.moves.shape, generator=draws, dtype=lens.moves.dtype)
        starts.append(_numbers_at(lens, descent.spread * normal))
    ends = [(_merit(begin, parts), begin)]
    ends += [_descend(start, parts) for start in counted(starts, "descending", "lenses")]
    for _ in counted(range(descent.rounds - 1), "descending on", "rounds"):
        ends.append(_descend(_best(ends)[1], parts))
    return _best(ends)[1]


def _best(ends: list[tuple[float, Tensor]]) -> tuple[float, Tensor]:
    return max(ends, key=lambda end: end[0])


def _numbers_at(lens: DesignLens, moves: Tensor) -> Tensor:
    with torch.no_grad():
        lens.moves.copy_(moves)
        return lens.scaled()


def _merit(scaled: Tensor, parts: Descending) -> float:
    lens = parts.make(scaled)
    with torch.no_grad():
        return -float(_loss(lens, parts.error_of(lens), parts.descent))


def _descend(begin: Tensor, parts: Descending) -> tuple[float, Tensor]:
    """Return merit and numbers of the best lens on the way down from one."""
    lens, descent = parts.make(begin), parts.descent
    error = parts.error_of(lens)
    best = (float("-inf"), begin)
    optimiser = torch.optim.LBFGS(
        [lens.moves],
        max_iter=descent.evaluations,
        max_eval=descent.evaluations,
        history_size=_HISTORY,
        line_search_fn="strong_wolfe",
    )

    def closure() -> Tensor:
        nonlocal best
        optimiser.zero_grad()
        loss = _loss(lens, error, descent)
        loss.backward()  # type: ignore[no-untyped-call]
        best = max(best, (-float(loss.detach()), lens.scaled().detach()), key=lambda end: end[0])
        return loss

    optimiser.step(closure)  # type: ignore[no-untyped-call]
    return best


def _loss(lens: DesignLens, error: ExpectedError, descent: Descent) -> Tensor:
    every_db, penalty = error(lens)
    return -every_db.mean() + descent.penalty_weight * penalty
