"""Pile-up undone; dark counts, hot and blind pixels go on beside the photons."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from camkit.bundle.stages import Correct
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.kinds.spad.captures.corrected import CorrectedRows
from camkit.runtime.kinds.spad.captures.photon_capture import photons_of

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final[tuple[str, ...]] = ()


def prepare(_entry: Correct, job: Job) -> StageWork:
    """Make ready; the maps of the capture are read with its first row."""
    capture = photons_of(job)

    def run(taken: Sequence[Stream]) -> tuple[Stream, ...]:
        (counts,) = taken
        rows = CorrectedRows(counts.rows(), capture, owned=counts.gives_own_rows)
        plane = counts.plane.model_copy(update={"type": "float32"})
        return (replace(counts.with_source(rows), plane=plane, beside=rows.pixels),)

    return StageWork(run=run)
