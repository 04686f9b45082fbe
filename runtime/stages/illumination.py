"""Division by the relative illumination, band by band."""

from collections.abc import Sequence
from typing import Final

from camkit.arrays import FloatArray
from camkit.bundle.stages import Illumination
from camkit.runtime.geometry.illumination import IlluminationGain
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.options import Options
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import changed_bands

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final = ("vignetting",)
REST_SHARE: Final = 0.03


def is_left_out(options: Options) -> bool:
    """Return whether the caller wants the vignetting kept."""
    return not options.vignetting


def prepare(_entry: Illumination, job: Job) -> StageWork:
    """Prepare the gain; nothing is decided here."""

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (light,) = streams
        gain = IlluminationGain(job.known_bundle.illumination, job.window_of(light.plane))

        def even(rows: FloatArray, top: int) -> None:
            gain.divide(rows, top, out=rows)

        return (light.with_bands(changed_bands(light.bands(), even, threads=job.threads)),)

    return StageWork(run=run)


def seconds(_entry: Illumination, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels
