"""The scene in coarse cells found before the first row; the haze taken out of rows as they pass."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from typing import Final

from camkit.bundle.haze_golden import MAX_CELLS
from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Dehaze
from camkit.errors import BundleError
from camkit.runtime.bank.cell_means import cell_count
from camkit.runtime.bank.haze import (
    KEPT_CAMERAS,
    CoarseBand,
    HazyKernels,
    few_are_kept,
    hazy_kernels,
    solve_coarse,
)
from camkit.runtime.bank.haze_costs import coarse_work, kept_bytes, solving_bytes
from camkit.runtime.cancel import cancellable
from camkit.runtime.job.coarse_cells import cells_of
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.machine.limits import BANK_WORK
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows, changed_bands

METHODS: Final = ("haze",)
OPTIONS: Final = ("depth_m",)
BYTES_PER_COLUMN: Final = 6_000
"""Of rows on their way."""
REST_SHARE: Final = 0.4
"""What lies before it is read once more, and a gain and a veil are put on every pixel."""
SOLVED_MP: Final = 3.0
"""The rounds take as long as the rest of so many megapixels."""
FIRST_MP: Final = 15.0
"""The few kernels that those of all places are made of likewise, for the first file of a process
(measured on one camera; that a second camera waits as well is not foreseen)."""


def check(entry: Dehaze, manifest: Manifest, _max_bytes: int) -> None:
    """Refuse several, cells that take more work than is admitted, and more than a case may hold.

    Raises:
        BundleError: If the bundle lists two, every pixel would be transformed too often, or the
            sensor has more than `MAX_CELLS` cells along a side.
    """
    count = len(manifest.stages_of(Dehaze))
    if count > 1:
        raise BundleError(f"a bundle has one stage haze at most; {manifest.name} has {count}")
    work = coarse_work(entry, len(manifest.sensor.channels))
    BANK_WORK.check(work, f"the haze of {manifest.name}")
    extent = manifest.sensor.extent
    side_px = 0 if extent is None else max(extent.width_px, extent.height_px)
    if cell_count(side_px, entry.shrink) > MAX_CELLS:
        raise BundleError(
            f"{manifest.name} has more than {MAX_CELLS} cells of {entry.shrink} px along a side; "
            "make shrink larger"
        )


def prepare(entry: Dehaze, job: Job) -> StageWork:
    """Return the coarse picture of the haze."""

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        picture = streams[0]

        @cache
        def band() -> CoarseBand:
            # whoever asks first, the time is this stage's
            with job.log.clock.stage(entry.type):
                return coarse_band(entry, picture, job)

        cleared = picture.with_bands(_cleared(picture, band, job.threads))
        return (replace(cleared, noise_rise=lambda: band().noise_rise),)

    capture = job.capture
    size_px = capture.width, capture.height
    haze, scale = job.known_bundle.haze, job.placement.kernel_scale
    return StageWork(
        run=run,
        held_bytes=BYTES_PER_COLUMN * capture.width
        + kept_bytes(entry, haze, capture.channels, scale),
        first_bytes=solving_bytes(entry, haze, capture.channels, size_px, scale),
    )


def seconds(_entry: Dehaze, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    first_mp = 0.0 if few_are_kept() else FIRST_MP
    return (REST_SHARE * subject.megapixels + SOLVED_MP + first_mp) * speed.rest_s_per_mp


def coarse_band(entry: Dehaze, picture: Stream, job: Job) -> CoarseBand:
    """Find the scene in cells.

    Args:
        entry: The manifest's stage.
        picture: What it clears.
        job: The capture; what lies before the stage is read once.
    """
    bundle = job.known_bundle
    cells = cells_of(job, entry.takes, entry.shrink)
    with cancellable(job.cancel):
        return solve_coarse(
            cells.means,
            cells.clipped,
            _kernels(bundle, job.options.depth_mm, job.placement.kernel_scale),
            job.window_of(picture.plane),
            terms=entry.terms,
            rounds=entry.rounds,
            threads=job.threads,
        )


@lru_cache(maxsize=KEPT_CAMERAS)
def _kernels(bundle: Bundle, depth_mm: float | None, scale: float) -> HazyKernels:
    """Return the kernels of a camera; the same ones to all its captures."""
    sensor = bundle.manifest.light_sensor
    response = sensor.response_arrays()
    return hazy_kernels(bundle.psf, bundle.haze, *response, depth_mm=depth_mm).scaled(scale)


def _cleared(picture: Stream, band: Callable[[], CoarseBand], threads: int) -> Iterator[Rows]:
    """Yield the bands of a picture without its haze; finds it when the first is asked for."""
    coarse = band()
    yield from changed_bands(picture.bands(), coarse.clear, threads=threads)
