"""Gains of the caller, the file, or the bundle's illuminant."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from camkit.bundle.stages import WhiteBalance
from camkit.cfa import CfaPattern
from camkit.colorimetry import camera_from_rec709
from camkit.runtime.job.job import Gains, Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows, RowSource
from camkit.runtime.signal.demosaic import apply_gains, shift_rows

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final = ("white_balance",)
REST_SHARE: Final = 0.04


def look(_entry: WhiteBalance, job: Job) -> Job:
    """Choose the gains."""
    return replace(job, white_balance=_choose(job))


def prepare(_entry: WhiteBalance, job: Job) -> StageWork:
    """Make ready; nothing is decided here."""
    cfa, gains = job.capture.cfa, job.white_balance

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (light,) = streams
        is_mosaic = light.shape[0] == 1
        rows = BalancedRows(
            light.rows(), gains, cfa if is_mosaic else None, owned=light.gives_own_rows
        )
        return (replace(light.with_source(rows), gains=gains),)

    return StageWork(run=run)


def seconds(_entry: WhiteBalance, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels


def _choose(job: Job) -> Gains:
    gains = job.options.white_balance or job.capture.white_balance
    if gains is not None:
        return gains
    if not job.capture.is_of_mosaic:
        return (1.0, 1.0, 1.0)
    sensor = None if job.bundle is None else job.bundle.manifest.sensor
    if sensor is None or sensor.type != "bayer":
        job.log.notes.append(
            "the capture states no white balance: gains of 1 are used, colours may have a cast"
        )
        return (1.0, 1.0, 1.0)
    job.log.notes.append(f"the capture states no white balance: {sensor.illuminant} is assumed")
    return camera_from_rec709(np.array(sensor.color_matrix))[1]


class BalancedRows:
    """Rows of a mosaic or of three planes, each colour multiplied by its gain."""

    def __init__(
        self, source: RowSource, gains: Gains, cfa: CfaPattern | None, *, owned: bool
    ) -> None:
        self._source = source
        self._gains = gains
        self._cfa = cfa
        self._owned = owned

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w)."""
        return self._source.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (channel, rows, w) float32, a new array."""
        rows = self._source.read(top, bottom)
        if not self._owned:
            rows = rows.copy()
        if self._cfa is None:
            rows *= np.array(self._gains, dtype=np.float32)[:, None, None]
            return rows
        red, green, blue = self._gains
        apply_gains(rows[0], shift_rows(self._cfa, top), (red, green, blue))
        return rows
