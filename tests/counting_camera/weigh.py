"""Counts multiplied by the caller's weights."""

from collections.abc import Sequence
from typing import Final

from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.rows import ArrayRows
from tests.counting_camera.runtime import Weigh, factor_of

METHODS: Final = ("running",)
OPTIONS: Final[tuple[str, ...]] = ()


def prepare(_entry: Weigh, job: Job) -> StageWork:
    """Look at the weights."""
    sign = -1 if job.options.kind_choice("sign") == "minus" else 1

    def run(taken: Sequence[Stream]) -> tuple[Stream, ...]:
        (counts,) = taken
        factor = sign * factor_of(job.options)
        return (counts.with_source(ArrayRows(counts.rows().read(0, 1) * factor)),)

    return StageWork(run=run)
