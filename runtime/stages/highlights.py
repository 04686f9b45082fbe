"""Clipped lights found from their streaks before the first row; rows painted as they pass."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import Final

import numpy as np

from camkit.bundle.stages import Highlights, Stage
from camkit.colorimetry import Matrix, rec709_from_camera
from camkit.errors import ContractError
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.cancel import check_cancelled
from camkit.runtime.color import recover_highlights
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows
from camkit.streaks.cells import COLOURS, PITCH_PX, Cells, cells_of, sample_sites
from camkit.streaks.kernels import StreakKernels, streak_kernels
from camkit.streaks.painting import Painter
from camkit.streaks.recovery import FINE_CELLS, recover

METHODS: Final = ("physics",)
OPTIONS: Final = ("depth_m",)
BYTES_PER_PX: Final = 22
"""Cells, veil, lights and streaks of a picture that is one window (measured)."""
FINE_BYTES_PER_PX: Final = 47
"""The same of one so small that its lights are judged in cells of 2 px (measured)."""
KEPT_BYTES_PER_PX: Final = 13
"""Veil, streaks and the pixels of lights, of a picture of which nearly too much clipped."""
BAND_ROWS: Final = 256
REST_SHARE: Final = 0.4
FRONT: Final = ("linearise", "repair")
LEAST_PX: Final = 4
"""Side of the coarser cells."""


def prepare(entry: Highlights, job: Job) -> StageWork:
    """Say which planes are looked at; a capture smaller than a cell is left as it is.

    Raises:
        ContractError: If no stage gives them.
    """
    height, width = job.capture.height, job.capture.width
    light, mask = _looked_at(entry, job.setup.stages)
    if min(height, width) < LEAST_PX:
        note = (
            f"lights are sought in pictures of {LEAST_PX} px and more on each side; this one has "
            f"{width} x {height}: it was left as the sensor saw it"
        )
        return StageWork(run=lambda taken: (taken[0],), warnings=lambda: (note,))
    notes: list[str] = []

    def run(taken: Sequence[Stream]) -> tuple[Stream, ...]:
        (picture,) = taken
        return (picture.with_bands(_painted(picture, job, (light, mask), notes)),)

    pixels = height * width
    return StageWork(
        run=run,
        held_bytes=KEPT_BYTES_PER_PX * pixels,
        first_bytes=first_bytes(pixels),
        warnings=lambda: tuple(notes),
    )


def seconds(_entry: Highlights, subject: Subject, _work: Work, speed: Speed) -> float:
    """Give the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels


def first_bytes(pixels: int) -> int:
    """Give the memory that a picture takes at most while its lights are sought."""
    fine_px = min(pixels, FINE_CELLS * PITCH_PX**2)
    return max(BYTES_PER_PX * pixels, FINE_BYTES_PER_PX * fine_px)


def _looked_at(entry: Highlights, stages: Sequence[Stage]) -> tuple[str, str]:
    """Name the planes of light and of what clipped, as they are before any gain.

    Raises:
        ContractError: If there are none.
    """
    before = takewhile(lambda stage: stage != entry and stage.type != "white_balance", stages)
    given = [stage.gives for stage in before if stage.type in FRONT and len(stage.gives) > 1]
    if not given:
        raise ContractError("highlights needs a stage that gives light and a mask of what clipped")
    return given[-1][0], given[-1][1]


def _painted(
    picture: Stream, job: Job, looked_at: tuple[str, str], notes: list[str]
) -> Iterator[Rows]:
    """Yield the bands of a picture with its lights; finds them when the first is asked for."""
    painter, top = _painter(job, looked_at, notes), 0
    red, green, blue = picture.gains
    for band in picture.bands():
        if painter.blind and job.capture.cfa is not None:
            recover_highlights(band, (red, green, blue), in_place=True)
        painter.paint(band, top, picture.gains)
        top += band.shape[1]
        yield band


def _painter(job: Job, looked_at: tuple[str, str], notes: list[str]) -> Painter:
    """Find the lights; what only the search needs is let go."""
    cells, kernels = _cells(job, *looked_at), _kernels(job)
    recovery = recover(cells, kernels, lambda: check_cancelled(job.cancel))
    notes[:] = recovery.notes
    job.sections["hdr"] = recovery.to_json()
    return Painter(recovery, _to_output(job))


def _to_output(job: Job) -> Matrix:
    """Give the matrix from balanced planes to Rec.709."""
    matrix = job.color_matrix
    return np.eye(COLOURS) if matrix is None else rec709_from_camera(matrix)


def _kernels(job: Job) -> StreakKernels:
    bundle = job.known_bundle
    sensor = bundle.manifest.sensor
    assert sensor.type != "spad"  # its counts never join
    kernels = color_kernels(
        bundle.psf,
        *sensor.response_arrays(),
        depth_mm=job.options.depth_mm,
        focus_um=job.options.focus_um,
    )
    scaled = kernels.scaled(job.placement.kernel_scale)
    reach_px = round(bundle.streaks.reach_px * job.placement.kernel_scale)
    return streak_kernels(scaled.at(0.0, 0.0), sample_sites(job.capture.cfa), reach_px)


def _cells(job: Job, light_plane: str, mask_plane: str) -> Cells:
    """Read the whole capture in cells."""
    samples, mask = job.probe(light_plane, mask_plane)
    sites = sample_sites(job.capture.cfa)
    height = samples.shape[1] // 2 * 2
    shape = COLOURS, height // 2, samples.shape[2] // 2
    # zeros that nothing is written to take no memory
    light, over = np.empty(shape, np.float32), np.zeros(shape, np.float32)
    pixels = np.zeros((samples.shape[0], *shape[1:]), np.uint8)
    for top in range(0, height, BAND_ROWS):
        bottom = min(top + BAND_ROWS, height)
        part = cells_of(samples.read(top, bottom), mask.read(top, bottom), sites)
        rows = slice(top // 2, bottom // 2)
        light[:, rows] = part.light
        if part.pixels.any():
            over[:, rows] = part.clipped
            pixels[:, rows] = part.pixels
    return replace(part, light=light, clipped=over, pixels=pixels)
