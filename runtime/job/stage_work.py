"""A stage of one capture, made ready: what a module of `camkit.runtime.stages` prepares."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from camkit.runtime.job.stream import Stream


def _nothing() -> tuple[str, ...]:
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class StageWork:
    """A stage of one capture, made ready.

    Attributes:
        run: Gives the streams of the planes that the stage gives, from those that it takes. The
            rows are made when they are read.
        held_bytes: Memory of the rows and whatever else it keeps, apart from what `fit` plans.
        first_bytes: Memory that it takes at most before it gives a row, while no window of a
            network is in memory; counts where it is more than what it holds and they plan.
        fit: Plans within a cap of which others take a share, both in bytes; None for a stage whose
            memory is fixed.
        planned_bytes: Memory of that plan.
        warnings: What the user should know once the last row is out.
    """

    run: Callable[[Sequence[Stream]], tuple[Stream, ...]]
    held_bytes: int = 0
    first_bytes: int = 0
    fit: Callable[[int, int], None] | None = None
    planned_bytes: Callable[[], int] = int
    warnings: Callable[[], tuple[str, ...]] = _nothing
