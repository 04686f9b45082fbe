"""The Wiener bank, or a classical method on its blocks."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Wiener
from camkit.caller import option_text
from camkit.errors import MemoryCapError
from camkit.psf import depth_name
from camkit.runtime.bank.baselines import TUNED_ON, method_numbers, restoration_bank
from camkit.runtime.bank.blocks import (
    BlockBank,
    LocalPsf,
    PlainBlock,
    Span,
    cut_block_px,
    lay_spans,
)
from camkit.runtime.bank.distance import CELL_PX, find_nearness, search_blocks
from camkit.runtime.bank.joint_colours import binned_model
from camkit.runtime.bank.kernels_by_distance import (
    KEPT_STEPS,
    MEAN,
    KernelsByDistance,
    NearnessMap,
)
from camkit.runtime.bank.lights import fitted_px, light_share
from camkit.runtime.bank.psf import FieldKernels, color_kernels
from camkit.runtime.capture import Capture
from camkit.runtime.content import LIGHT_PX
from camkit.runtime.job.coarse_cells import cells_of
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.job.walker import FIXED_BYTES
from camkit.runtime.machine.limits import BANK_WORK
from camkit.runtime.options import Options
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.idle_blocks import plain_blocks
from camkit.runtime.plan.speed import Speed
from camkit.runtime.plan.tuning import Tuning, stated_numbers
from camkit.runtime.rows import Rows
from camkit.runtime.unit import FOCUS

METHODS: Final = ("wiener", "rl", "admm-tv")
OPTIONS: Final = ("depth_m", "noise", "iso")
FACTS: Final = (FOCUS,)
FOLLOWS: Final = "noise and level of every block, hence the ISO"
ESTIMATED: Final = "estimated"
KERNEL_BLOCKS: Final = 3.2
"""A kernel of another place with its transform, in blocks that are only filtered (measured)."""
MOSAIC_BLOCKS: Final = 1.3
"""A block that is restored from the samples of the mosaic, in blocks of planes: 1.37 for filtering,
1.25 for its place (measured: docs/results/mosaic.json)."""
KEPT_CAMERAS: Final = 1
"""Cameras whose kernels of all distances are kept, since its next capture needs them too."""
CELLS_SHARE: Final = 0.6
"""Reading a capture in cells, in what everything but bank and network takes (measured: 0.05
CPU-seconds per megapixel)."""
SEARCH_BLOCKS: Final = 2.2
"""Asking a block for its distance, in blocks that are filtered (measured: 4.6 CPU-milliseconds)."""
KERNELS_SHARE: Final = 0.1
"""Making the kernels of all distances, per million samples of the PSF, likewise (measured: 0.08
CPU-seconds for 12 million)."""
LIGHTS_AT_LEAST: Final = 1 / 7
"""Of explaining a block as a whole, what it costs however small the windows (two transforms)."""
PLANES_HELD: Final = 5
PLANES_PER_BLOCK: Final = 5
"""Block-sized planes of every channel: kept, and per block that is being restored (measured)."""
BYTES_PER_BLOCK_ROW: Final = 56
"""Of a row of blocks, per column of the picture and row of a block (measured)."""


def check(entry: Wiener, manifest: Manifest, max_bytes: int) -> None:
    """Refuse blocks that take more work than is admitted, or more memory than there is.

    Raises:
        BundleError: If every pixel would be transformed too often.
        MemoryCapError: If one block does not fit.
    """
    channels = len(manifest.sensor.channels)
    BANK_WORK.check(bank_work(entry, channels), f"the Wiener bank of {manifest.name}")
    least = FIXED_BYTES + block_bytes(entry.block_px, channels, threads=1)
    if least > max_bytes:
        raise MemoryCapError(
            f"the Wiener bank of {manifest.name} has blocks of {entry.block_px} px, which take "
            f"{least // 10**6} MB; got {max_bytes // 10**6} MB: raise "
            f"{option_text('max_mem_bytes', least)}",
            least,
        )


def bank_work(entry: Wiener, channels: int) -> float:
    """Return the most transforms per pixel: overlaps, channels, rounds of clipping.

    A block takes a transform for its kernel and two for its filter; where samples are clipped,
    four for every round of Richardson-Lucy and two each for what it explains and leaves.
    """
    transforms = 3 + (4 * entry.clip_iterations + 2 if entry.clip_iterations else 0)
    share = (entry.block_px / (entry.block_px - entry.overlap_px)) ** 2
    return channels * transforms * share


def block_bytes(block_px: int, channels: int, *, threads: int) -> int:
    """Return the memory in which some threads restore a block each (measured)."""
    return 4 * channels * block_px * block_px * (PLANES_HELD + PLANES_PER_BLOCK * threads)


def look(_entry: Wiener, job: Job) -> Job:
    """Return the job with its noise."""
    return job.with_noise()


def prepare(entry: Wiener, job: Job) -> StageWork:
    """Return the bank: the kernels, where there is a choice, and the noise."""
    bundle, depth_mm = job.known_bundle, job.options.depth_mm
    depths_mm = bundle.psf.depths_mm
    if depths_mm.size > 1:
        distances = ", ".join(map(depth_name, depths_mm))
        default = ESTIMATED if entry.depth == ESTIMATED else f"mean of {distances}"
        job.log.record["depth"] = default if depth_mm is None else depth_name(depth_mm)
    if job.options.unit is not None and FOCUS in job.options.unit.facts:
        job.log.record[FOCUS] = job.options.focus_um

    def warnings() -> tuple[str, ...]:
        nearness = job.cache.get(_nearness_key(entry))
        return () if nearness is None else (nearness.describe(),)

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        return (replace(streams[0].with_bands(_restored(entry, job, streams)), noise_rise=None),)

    size_px = job.capture.width, job.capture.height
    block_px = cut_block_px(entry.block_px, entry.overlap_px, size_px)
    columns = len(lay_spans(job.capture.width, block_px, entry.overlap_px))
    threads = min(job.threads, columns)
    held_bytes = max(
        BYTES_PER_BLOCK_ROW * block_px * job.capture.width,
        block_bytes(block_px, len(bundle.manifest.sensor.channels), threads=threads),
    )
    if _finds_distance(entry, bundle, job.options):
        fields, depths, _, *sides = bundle.psf.kernels.shape
        colours = len(bundle.manifest.sensor.channels)
        # those of all depths once more in cells are smaller than one
        held_bytes += 4 * fields * colours * math.prod(sides) * (depths + KEPT_STEPS + 1)
    return StageWork(run=run, held_bytes=held_bytes, warnings=warnings)


def _restored(entry: Wiener, job: Job, streams: Sequence[Stream]) -> Iterator[Rows]:
    """Yield the restored bands; makes the bank when the first is asked for."""
    planes, mask = streams[0], streams[1] if len(streams) > 1 else None
    bank = make_bank(entry, job, planes)
    unknown = None if mask is None else mask.rows().read
    yield from bank.restore_bands(planes.rows(), unknown, _plain(job), job.cancel)


def tuning(entry: Wiener, method: str) -> Tuning:
    """Return the tuning of a method: of the bank by its bundle, of the others by camkit."""
    if method == METHODS[0]:
        values = stated_numbers(entry)
        if entry.together is not None:
            values |= {f"together_{k}": v for k, v in stated_numbers(entry.together).items()}
        source = "stage wiener of the bundle"
        fitted = "" if entry.together is None else "; those of together by camkit fit-bank"
        return Tuning(values=values, source=source + fitted, follows=FOLLOWS)
    grid = {name: getattr(entry, name) for name in ("block_px", "overlap_px")}
    return Tuning(
        values=grid | dict(method_numbers(method)),
        source="grid: stage wiener of the bundle; all else: camkit, the same for every camera",
        captures=f"{TUNED_ON}; which ones is not recorded",
        follows=FOLLOWS,
    )


def make_bank(entry: Wiener, job: Job, planes: Stream) -> BlockBank:
    """Make the bank of a capture.

    Args:
        entry: The manifest's stage.
        job: The capture.
        planes: What it will restore.
    """
    bundle = job.known_bundle
    sensor = bundle.manifest.light_sensor
    window, binning = job.window_of(planes.plane), job.capture.binning
    scale = job.placement.kernel_scale * (1 if binning is None else binning.side_px)
    camera = bundle, job.options.focus_um, scale
    choice = None
    if _finds_distance(entry, bundle, job.options):
        nearness = _nearness(entry, job, planes)
        by_distance = _kernels_by_distance(*camera)
        choice = by_distance.of_scene(nearness)
        kernels = by_distance.at_step(MEAN)
    else:
        kernels = _kernels(bundle, job.options.depth_mm, *camera[1:])
    local = LocalPsf(kernels=kernels, window=window, choice=choice, binning=binning)
    method = job.work.method if job.work.method in METHODS else METHODS[0]
    noise = job.noise.with_gains(planes.gains)
    if entry.together is not None and method == METHODS[0]:
        # its numbers were fitted to noise of this sensor; with less it would trust its kernels more
        least = sensor.noise_at(min(one.iso for one in sensor.noise))
        if binning is not None:
            least = least.raised(binning.noise_factors)
        noise = noise.at_least(least.with_gains(planes.gains))
    if planes.noise_rise is not None:
        noise = noise.raised(planes.noise_rise())
    side = cut_block_px(entry.block_px, entry.overlap_px, local.window.size_px)
    cut = entry.model_copy(update={"block_px": max(side, *local.kernels.kernels.shape[-2:])})
    if binning is not None and cut.together is not None:
        together = binned_model(cut.together, binning.side_px)
        cut = cut.model_copy(update={"together": together, "mosaic": None})
    red = _red_of(job.capture, planes)
    return restoration_bank(local, cut, noise, method=method, threads=job.threads, red=red)


def _red_of(capture: Capture, planes: Stream) -> tuple[int, int] | None:
    """Return (row, column) of red in the mosaic that planes hold the samples of; None for none."""
    if capture.cfa is None or planes.shape[1:] != (capture.height, capture.width):
        return None
    return divmod(capture.cfa.index("R"), 2)


def _kernels(bundle: Bundle, depth_mm: float | None, focus_um: float, scale: float) -> FieldKernels:
    """Return the kernels of an object distance; None for the mean."""
    sensor = bundle.manifest.light_sensor
    return color_kernels(
        bundle.psf,
        *sensor.response_arrays(),
        depth_mm=depth_mm,
        focus_um=focus_um,
        share=bundle.haze.core_share if bundle.manifest.has_haze else None,
    ).scaled(scale)


@lru_cache(maxsize=KEPT_CAMERAS)
def _kernels_by_distance(bundle: Bundle, focus_um: float, scale: float) -> KernelsByDistance:
    """Return the kernels of all distances; the same ones to all captures of a camera."""
    depths_mm = bundle.psf.depths_mm
    kernels = [_kernels(bundle, float(depth_mm), focus_um, scale) for depth_mm in depths_mm]
    return KernelsByDistance(depths_mm, kernels)


def _finds_distance(entry: Wiener, bundle: Bundle, options: Options) -> bool:
    """Return whether the distance is found in the capture."""
    several = bundle.psf.depths_mm.size > 1
    return entry.depth == ESTIMATED and options.depth_mm is None and several


def _nearness(entry: Wiener, job: Job, planes: Stream) -> NearnessMap:
    """Return the distance of every part of the capture."""
    key = _nearness_key(entry)
    if (nearness := job.cache.get(key)) is None:
        kernels = _kernels_by_distance(
            job.known_bundle, job.options.focus_um, job.placement.kernel_scale
        )
        cells = cells_of(job, entry.takes, CELL_PX)
        nearness = job.cache[key] = find_nearness(
            cells.means,
            cells.clipped,
            kernels,
            job.window_of(planes.plane),
            noise=job.noise.with_gains(planes.gains),
            cfa=cells.cfa,
            threads=job.threads,
        )
    job.log.sections["distance"] = nearness.to_json()
    result: NearnessMap = nearness
    return result


def _nearness_key(entry: Wiener) -> tuple[str, tuple[str, ...]]:
    """Return the key of what was found of the distance, among what is kept of a capture."""
    return "nearness", entry.takes


def _plain(job: Job) -> PlainBlock | None:
    """Return the test for blocks that nothing but plain cells read; None without any."""
    work, subject = job.work, job.subject
    if work.labels is None or subject is None:
        return None
    reach = max((subject.reach_px(size) for size in work.sizes()), default=0)
    return plain_blocks(work.labels, reach)


def seconds(entry: Wiener, subject: Subject, work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    size_px = subject.height_px, subject.width_px
    block_px = cut_block_px(entry.block_px, entry.overlap_px, size_px)
    rows, columns = (lay_spans(side, block_px, entry.overlap_px) for side in size_px)
    finds = _finds_distance(entry, subject.bundle, subject.options)
    set_up = 1 + KERNEL_BLOCKS * (1.0 if finds else _kernel_share(subject, columns))
    blocks = np.full((len(rows), len(columns)), set_up * speed.block_s)
    if entry.mosaic is not None and subject.side_px == 1:
        window = subject.placement.window
        across, down = ([span.centre for span in spans] for spans in (columns, rows))
        heights_mm = np.hypot(*window.to_mm(np.array(across), np.array(down)[:, None]))
        blocks[heights_mm <= entry.mosaic.within_mm] *= MOSAIC_BLOCKS
    if subject.content is not None and entry.clip_iterations:
        kernel_px = fitted_px(entry, max(subject.bundle.psf.kernels.shape[-2:]))
        work_share = _light_work(entry, subject.content.lights, (rows, columns), kernel_px)
        blocks += work_share * (speed.clipped_block_s - speed.block_s)
    if work.labels is not None:
        reach = max((subject.reach_px(size) for size in work.sizes()), default=0)
        test = plain_blocks(work.labels, reach)
        if test is not None:
            blocks *= [[not test(row, column) for column in columns] for row in rows]
    found_s = _search_seconds(subject, speed) if finds else 0.0
    return float(blocks.sum()) / speed.threads + found_s


def _search_seconds(subject: Subject, speed: Speed) -> float:
    """Return the seconds of finding the distance; the first capture pays for the kernels."""
    is_cached = _kernels_by_distance.cache_info().currsize > 0
    made_mp = 0.0 if is_cached else KERNELS_SHARE * subject.bundle.psf.kernels.size / 1e6
    rest_mp = CELLS_SHARE * subject.megapixels + made_mp
    blocks = search_blocks((subject.height_px, subject.width_px))
    return rest_mp * speed.rest_s_per_mp + SEARCH_BLOCKS * blocks * speed.block_s / speed.threads


def _kernel_share(subject: Subject, columns: Sequence[Span]) -> float:
    """Return the share of blocks with a kernel of their own; mirrored places share one."""
    kernels = subject.bundle.psf.field_heights_mm.size
    window = subject.placement.window
    places = {round(abs(float(window.to_mm(c.centre, 0)[0])), 6) for c in columns}
    return 0.0 if kernels == 1 else len(places) / len(columns)


def _light_work(
    entry: Wiener,
    lights: NDArray[np.bool_],
    spans: tuple[Sequence[Span], Sequence[Span]],
    kernel_px: int | None,
) -> NDArray[np.float64]:
    """Return (row, column): what clipped samples cost a block, 1 where all is explained."""
    rows, columns = spans
    block_px = rows[0].index.size
    work = np.zeros((len(rows), len(columns)))
    for i, row in enumerate(rows):
        down = slice(row.index.min() // LIGHT_PX, row.index.max() // LIGHT_PX + 1)
        for j, column in enumerate(columns):
            across = slice(column.index.min() // LIGHT_PX, column.index.max() // LIGHT_PX + 1)
            squares = lights[down, across]
            if squares.any():
                side = block_px // LIGHT_PX
                share = light_share(
                    squares[:side, :side], block_px, kernel_px, entry, step_px=LIGHT_PX
                )
                work[i, j] = LIGHTS_AT_LEAST + (1 - LIGHTS_AT_LEAST) * min(share, 1.0)
    return work
