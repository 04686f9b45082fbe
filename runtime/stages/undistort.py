"""The radial distortion undone, band by band."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from camkit.bundle.stages import Undistort
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.options import Options
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final = ("undistort",)
BYTES_PER_COLUMN: Final = 4_280
"""Of rows on their way (measured, see docs/guides/performance.md)."""
LIMITED_BYTES_PER_COLUMN: Final = 1_060
"""Of what is looked at where overshoot is limited: four bytes a sample of a band."""
REST_SHARE: Final = 0.25
CUBIC_SHARE: Final = 0.32
"""Of the time of Lanczos (`python -m tools.plan.undistortion` at 2a55aa66)."""


def is_left_out(options: Options) -> bool:
    """Return whether the caller wants the geometry of the sensor kept."""
    return not options.undistort


def prepare(entry: Undistort, job: Job) -> StageWork:
    """Prepare the warp; nothing is decided here."""

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (light,) = streams
        bands = undistort_bands(
            light.pieced(),
            job.known_bundle.distortion,
            job.window_of(light.plane),
            threads=job.threads,
            interpolation=entry.interpolation,
            overshoot=entry.overshoot,
            places=entry.places,
        )
        plane = job.known_bundle.manifest.planes[entry.gives[0]]
        return (replace(light.with_bands(bands), plane=plane),)

    bytes_per_column = BYTES_PER_COLUMN
    if entry.overshoot == "limited":
        bytes_per_column += LIMITED_BYTES_PER_COLUMN
    return StageWork(run=run, held_bytes=bytes_per_column * job.capture.width)


def seconds(entry: Undistort, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    share = CUBIC_SHARE if entry.interpolation == "cubic" else 1.0
    return share * REST_SHARE * speed.rest_s_per_mp * subject.megapixels
