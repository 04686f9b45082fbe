"""Clipped lights found from their streaks before the first row; rows painted as they pass.

colours            -> veil and streaks taken out, lights put in
colours and mosaic -> veil and streaks taken from the samples -> demosaicked -> lights put in
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import Final

import numpy as np

from camkit.bundle.sensor import MOSAIC
from camkit.bundle.stages import Highlights, Stage
from camkit.errors import ContractError
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.cancel import check_cancelled
from camkit.runtime.capture import Capture
from camkit.runtime.color import rec709_of_planes, recover_highlights
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS, PITCH_PX, Cells, cells_of, sample_sites
from camkit.runtime.kinds.hdr.streaks.doubt import BLOCK_PX
from camkit.runtime.kinds.hdr.streaks.doubt import MARGIN_PX as DOUBT_MARGIN_PX
from camkit.runtime.kinds.hdr.streaks.kernels import StreakKernels, streak_kernels
from camkit.runtime.kinds.hdr.streaks.painting import Painter
from camkit.runtime.kinds.hdr.streaks.recovery import FINE_CELLS, MANY_SAMPLES, recover
from camkit.runtime.kinds.hdr.streaks.rims import MARGIN_PX as RIM_MARGIN_PX
from camkit.runtime.kinds.hdr.streaks.rims import near_clipped, no_brighter
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import RollingRows, Rows, read_bands
from camkit.runtime.signal.demosaic import DemosaicMethod
from camkit.runtime.stages.demosaic import ColorRows

METHODS: Final = ("physics",)
ON_MOSAIC: Final = True
OPTIONS: Final = ("depth_m", "demosaic")
BYTES_PER_PX: Final = 22
"""Cells, veil, lights and streaks of a picture that is one window (measured)."""
FINE_BYTES_PER_PX: Final = 47
"""The same of one so small that its lights are judged in cells of 2 px (measured)."""
KEPT_BYTES_PER_PX: Final = 17
"""Veil, streaks and the pixels of lights, of a picture of which nearly too much clipped."""
BAND_ROWS: Final = 256
TILE_COLUMNS: Final = 256
"""Of a band at once: what clipped takes three times the time, so it is sought in small tiles."""
CLEARED_ROWS: Final = 64 * BLOCK_PX
"""Of a mosaic at once: neighbours to the number of `DOUBT_MARGIN_PX` are computed again."""
LIT_ROWS: Final = 64
"""Of a picture at once, in the cache."""
REST_SHARE: Final = 0.4
FRONT: Final = ("linearise", "repair")
LEAST_PX: Final = 4
"""Side of the coarser cells."""


def prepare(entry: Highlights, job: Job) -> StageWork:
    """Return the search for lights; a capture smaller than a cell is left as it is.

    Raises:
        ContractError: If no stage gives them.
    """
    height, width = job.capture.height, job.capture.width
    light, mask = _looked_at(entry, job.setup.stages)
    if min(height, width) < LEAST_PX:
        note = (
            f"clipped lights are not restored: that needs {LEAST_PX} px on each side, and the "
            f"picture has {width} x {height}"
        )
        return StageWork(run=lambda streams: (streams[0],), warnings=lambda: (note,))
    notes: list[str] = []

    method = job.options.demosaic or entry.method

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        picture, *samples = streams
        if not samples or samples[0].plane.channels != MOSAIC:
            bands = _painted(picture, job, (light, mask), notes)
        else:
            bands = _from_samples([picture, *samples], job, (light, mask), notes, method)
        return (picture.with_bands(bands),)

    pixels = height * width
    return StageWork(
        run=run,
        held_bytes=KEPT_BYTES_PER_PX * pixels,
        first_bytes=first_bytes(pixels),
        warnings=lambda: tuple(notes),
    )


def seconds(_entry: Highlights, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels


def first_bytes(pixels: int) -> int:
    """Return the memory that a picture takes at most while its lights are sought."""
    fine_px = min(pixels, FINE_CELLS * PITCH_PX**2)
    return max(BYTES_PER_PX * pixels, FINE_BYTES_PER_PX * fine_px)


def _looked_at(entry: Highlights, stages: Sequence[Stage]) -> tuple[str, str]:
    """Return the planes of light and of clipped samples, as they are before any gain.

    Raises:
        ContractError: If there are none.
    """
    front_stages = takewhile(lambda stage: stage != entry and stage.type != "white_balance", stages)
    outputs = [
        stage.gives for stage in front_stages if stage.type in FRONT and len(stage.gives) > 1
    ]
    if not outputs:
        raise ContractError("highlights needs a stage that gives light and a mask of what clipped")
    return outputs[-1][0], outputs[-1][1]


def _painted(
    picture: Stream, job: Job, looked_at: tuple[str, str], notes: list[str]
) -> Iterator[Rows]:
    """Yield the bands of a picture with its lights; finds them when the first is asked for."""
    painter = _painter(job, looked_at, notes)
    yield from _bands_painted(picture, painter, job)


def _bands_painted(picture: Stream, painter: Painter, job: Job) -> Iterator[Rows]:
    """Yield the bands of a picture with its lights."""
    top = 0
    red, green, blue = picture.gains
    for band in picture.bands():
        if painter.blind and job.capture.cfa is not None:
            recover_highlights(band, (red, green, blue), in_place=True)
        painter.paint(band, top, picture.gains)
        top += band.shape[1]
        yield band


def _from_samples(
    streams: list[Stream],
    job: Job,
    looked_at: tuple[str, str],
    notes: list[str],
    method: DemosaicMethod,
) -> Iterator[Rows]:
    """Yield the bands of a picture whose streaks are taken from its mosaic.

    Args:
        streams: The picture and its mosaic; emptied, since rows are kept for all who hold a stream.
        job: The capture.
        looked_at: Planes of light and of what clipped.
        notes: For what the search has to say.
        method: Of the demosaic.
    """
    painter = _painter(job, looked_at, notes, least_samples=1)
    mosaic, picture = streams.pop(), streams.pop()
    if painter.blind:
        del mosaic
        yield from _bands_painted(picture, painter, job)
        return
    cfa, capture = job.capture.cfa, job.capture
    assert cfa is not None  # it is a mosaic
    cleared = RollingRows(mosaic.shape, _cleared(mosaic, painter, capture)).reader()
    colours = ColorRows(cleared, cfa, method, threads=job.threads)
    # in high bands: what a demosaic looks at above and below is computed for each
    source = RollingRows(colours.shape, read_bands(colours)).reader()
    captured, gains, height = picture.pieced(), mosaic.gains, capture.height
    del picture, mosaic
    for top in range(0, height, LIT_ROWS):
        bottom = min(top + LIT_ROWS, height)
        above, below = max(top - RIM_MARGIN_PX, 0), min(bottom + RIM_MARGIN_PX, height)
        clipped = capture.saturated_rows(above, below)
        if not clipped.any():  # nothing beside these rows is looked at
            above, below, clipped = top, bottom, clipped[top - above : bottom - above]
        planes = np.concatenate(source.pieces(above, below), axis=1)
        painter.light_up(planes, clipped, above, gains)
        inside = np.s_[..., top - above : bottom - above, :]
        lit, near = planes[inside], near_clipped(clipped)[inside]
        no_brighter(lit, captured.read(top, bottom), near)
        yield np.ascontiguousarray(lit)


def _cleared(mosaic: Stream, painter: Painter, capture: Capture) -> Iterator[Rows]:
    """Yield the bands of a balanced mosaic without veil and streaks."""
    source, sites, gains = mosaic.rows(), sample_sites(capture.cfa), mosaic.gains
    del mosaic
    for top in range(0, capture.height, CLEARED_ROWS):
        bottom = min(top + CLEARED_ROWS, capture.height)
        above = max(top - DOUBT_MARGIN_PX, 0)
        below = min(-(-bottom // BLOCK_PX) * BLOCK_PX + DOUBT_MARGIN_PX, capture.height)
        rows = source.read(above, below)[0].copy()
        painter.clear(rows, capture.saturated_rows(above, below), above, sites, gains)
        yield rows[None, top - above : bottom - above]


def _painter(
    job: Job,
    looked_at: tuple[str, str],
    notes: list[str],
    *,
    least_samples: int = MANY_SAMPLES,
) -> Painter:
    """Find the lights; what only the search needs is let go."""
    cells, kernels = _cells(job, *looked_at), _kernels(job)
    recovery = recover(
        cells, kernels, lambda: check_cancelled(job.cancel), least_samples=least_samples
    )
    notes[:] = recovery.notes
    job.log.sections["hdr"] = recovery.to_json()
    return Painter(recovery, rec709_of_planes(job.color_matrix))


def _kernels(job: Job) -> StreakKernels:
    bundle = job.known_bundle
    sensor = bundle.manifest.light_sensor
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
    light, clipped = np.empty(shape, np.float32), np.zeros(shape, np.float32)
    pixels = np.zeros((samples.shape[0], *shape[1:]), np.uint8)
    for top in range(0, height, BAND_ROWS):
        bottom = min(top + BAND_ROWS, height)
        band, mask_band = samples.read(top, bottom), mask.read(top, bottom)
        for left in range(0, 2 * shape[2], TILE_COLUMNS):
            columns = slice(left, min(left + TILE_COLUMNS, 2 * shape[2]))
            part = cells_of(band[..., columns], mask_band[..., columns], sites)
            at = np.s_[:, top // 2 : bottom // 2, columns.start // 2 : columns.stop // 2]
            light[at] = part.light
            if part.pixels.any():
                clipped[at] = part.clipped
                pixels[at] = part.pixels
    return replace(part, light=light, clipped=clipped, pixels=pixels)
