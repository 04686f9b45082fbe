"""Streaks of glare found before the first row, and taken out of the rows as they pass."""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.manifest import Manifest
from camkit.bundle.stages import Deglare
from camkit.errors import BundleError
from camkit.runtime.cancel import check_cancelled
from camkit.runtime.job.job import Gains, Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.kinds.hdr.deglare.removal import Glare, GlareSettings, Read, find_glare
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows

METHODS: Final = ("deglare",)
OPTIONS: Final[tuple[str, ...]] = ()
BYTES_PER_COLUMN: Final = 52_000
"""Of the slant with its fields, and of rows on their way (measured)."""
REST_SHARE: Final = 1.0
"""What lies before it is read twice more."""
OVERVIEW_MP: Final = 0.4
SEARCH_SHARE: Final = 10.0
"""Of the search in an overview, which is never larger."""


def prepare(entry: Deglare, job: Job) -> StageWork:
    """Return the search for streaks."""
    settings = GlareSettings(
        least_rad=math.radians(entry.least_angle_deg),
        most_rad=math.radians(entry.most_angle_deg),
        reach=entry.reach,
        level=entry.level,
    )
    glares: list[Glare] = []

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (picture,) = streams
        return (picture.with_bands(_cleared(picture, job, entry.takes[0], settings, glares)),)

    return StageWork(
        run=run,
        held_bytes=BYTES_PER_COLUMN * job.capture.width,
        warnings=lambda: tuple(note for glare in glares for note in glare.notes),
    )


def check(_entry: Deglare, manifest: Manifest, _max_bytes: int) -> None:
    """Refuse several: each reads twice what lies before it, another one included.

    Raises:
        BundleError: If there are.
    """
    count = len(manifest.stages_of(Deglare))
    if count > 1:
        raise BundleError(f"a bundle has one stage deglare at most; {manifest.name} has {count}")


def seconds(_entry: Deglare, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    searched = SEARCH_SHARE * min(subject.megapixels, OVERVIEW_MP)
    return (REST_SHARE * subject.megapixels + searched) * speed.rest_s_per_mp


def _cleared(
    picture: Stream, job: Job, plane: str, settings: GlareSettings, glares: list[Glare]
) -> Iterator[Rows]:
    """Yield the bands of a picture without its streaks; finds them when the first is asked for."""
    _, height, width = picture.shape
    glare = find_glare(
        lambda: _opened(job, plane, picture.gains),
        height,
        width,
        settings,
        lambda: check_cancelled(job.cancel),
    )
    glares[:] = [glare]
    job.log.sections["glare"] = glare.to_json()
    top = 0
    for band in picture.bands():
        glare.paint(band, top, picture.gains)
        top += band.shape[1]
        yield band


def _opened(job: Job, plane: str, gains: Gains) -> Read:
    """Start to read a plane; every colour clips at 1, NaN is dark."""
    (rows,) = job.probe(plane)
    gain = np.array(gains, np.float32)[:, None, None]

    def read(top: int, bottom: int) -> FloatArray:
        band = np.asarray(rows.read(top, bottom) / gain, np.float32)
        np.nan_to_num(band, copy=False, nan=0.0, posinf=1.0, neginf=0.0)
        return band

    return read
