"""The time limit of a run while it prepares: asked between parts that take seconds each."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.progress import duration
from camkit.stopwatch import Stopwatch


@dataclass(slots=True, kw_only=True)
class TimeLimit:
    """A limit of a run.

    Attributes:
        stopwatch: Counts the time of the run.
        max_minutes: Of wall time; None for no limit.
        max_cpu_minutes: Of CPU time; None for no limit.
    """

    stopwatch: Stopwatch
    max_minutes: float | None
    max_cpu_minutes: float | None
    _begin_s: tuple[float, float] = field(init=False)

    def __post_init__(self) -> None:
        self._begin_s = self._spent_s()

    def check(self, what: str, done: int, total: int, *, reused: int) -> None:
        """Refuse to go on if the next part would end behind the limit.

        Args:
            what: Plural noun of the parts.
            done: Parts that are there.
            total: All parts.
            reused: Those of `done` that an earlier run made.

        Raises:
            ContractError: If so.
        """
        parts = done - reused
        if not parts or done == total:
            return
        for spent_s, begin_s, minutes, name in zip(
            self._spent_s(),
            self._begin_s,
            (self.max_minutes, self.max_cpu_minutes),
            ("max_minutes", "max_cpu_minutes"),
            strict=True,
        ):
            part_s = (spent_s - begin_s) / parts
            if minutes is not None and spent_s + part_s > 60 * minutes:
                left_s = (total - done) * part_s + begin_s
                raise ContractError(
                    f"no step was trained: after {duration(spent_s)} of {minutes:g} minutes "
                    f"{done} of {total} {what} are ready, and another takes {duration(part_s)}; "
                    f"they are kept: a repeat in this folder makes the other {total - done} in "
                    f"about {duration(left_s)}, before samples, validation and steps; give "
                    f"more as {option_text(name)}"
                )

    def _spent_s(self) -> tuple[float, float]:
        return self.stopwatch.wall_s(), self.stopwatch.cpu_s()


_limit: ContextVar[TimeLimit | None] = ContextVar("camkit_time_limit", default=None)


@contextmanager
def limited(
    stopwatch: Stopwatch, max_minutes: float | None, max_cpu_minutes: float | None
) -> Iterator[None]:
    """Limit the preparation in this block; see `TimeLimit`."""
    token = _limit.set(
        TimeLimit(stopwatch=stopwatch, max_minutes=max_minutes, max_cpu_minutes=max_cpu_minutes)
    )
    try:
        yield
    finally:
        _limit.reset(token)


def check_time(what: str, done: int, total: int, *, reused: int = 0) -> None:
    """Check the limit of this thread's run, if it has one; see `TimeLimit.check`.

    Raises:
        ContractError: If the next part would end behind it.
    """
    limit = _limit.get()
    if limit is not None:
        limit.check(what, done, total, reused=reused)
