"""Camera colour to the colour that the caller asked for; one channel becomes grey."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.sensor import RGB
from camkit.bundle.stages import Color
from camkit.runtime.color import ColorStage, color_stage, to_output
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows, read_bands

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final = ("color", "exposure_ev")
BYTES_PER_COLUMN: Final = 1_000
"""Of rows on their way (measured, see docs/guides/performance.md)."""
REST_SHARE: Final = 0.06


def look(_entry: Color, job: Job) -> Job:
    """Choose the colour matrix."""
    options, matrix = job.options, job.color_matrix
    if matrix is None and job.capture.is_of_mosaic:
        job.log.notes.append(
            "no colour matrix: camera RGB is used as Rec.709, colours are approximate"
        )
    color = color_stage(matrix, options.color, exposure_ev=options.exposure_ev)
    return replace(job, color=color)


def prepare(_entry: Color, job: Job) -> StageWork:
    """Make ready; nothing is decided here."""
    assert job.color is not None  # it has looked
    color = job.color

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (light,) = streams
        plane = light.plane.model_copy(update={"channels": RGB, "domain": "output"})
        shape = (len(RGB), *light.shape[1:])
        # a product of matrices may differ in its last bit with the rows that it gets
        bands = _converted(read_bands(light.pieced()), color)
        return (replace(light.with_bands(bands), plane=plane, shape=shape),)

    return StageWork(run=run, held_bytes=BYTES_PER_COLUMN * job.capture.width)


def _converted(bands: Iterator[Rows], color: ColorStage) -> Iterator[FloatArray]:
    for band in bands:
        wide = band if band.shape[0] == len(RGB) else np.repeat(band, len(RGB), axis=0)
        yield to_output(wide, color)


def seconds(_entry: Color, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels
