"""Burnt-out light made neutral, band by band."""

from collections.abc import Sequence
from typing import Final

from camkit.arrays import FloatArray
from camkit.bundle.stages import RaiseClipped
from camkit.runtime.color import recover_highlights
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import changed_bands

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final[tuple[str, ...]] = ()
REST_SHARE: Final = 0.03


def prepare(_entry: RaiseClipped, job: Job) -> StageWork:
    """Prepare the work; planes that come as such have no known level at which they clip."""

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (light,) = streams
        if not job.capture.is_of_mosaic:
            return (light,)
        red, green, blue = light.gains

        def lift(rows: FloatArray, _: int) -> None:
            recover_highlights(rows, (red, green, blue), in_place=True)

        return (light.with_bands(changed_bands(light.bands(), lift, threads=job.threads)),)

    return StageWork(run=run)


def seconds(_entry: RaiseClipped, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels
