"""What the stage does: the whole capture is read, its scene is sought, and its rows are given."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.manifest import Manifest
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import ArrayRows, Rows, read_bands
from tests.lensless_camera.entry import LenslessAdmm
from tests.lensless_camera.solver import GRADIENT_PLANES, PLANES, Settings, Solved, grid_of, solve

METHODS: Final = ("lensless",)
OPTIONS: Final = ("depth_m",)
SECTION: Final = "lensless"
ROUND_SHARE: Final = 0.08
"""A round on a megapixel of the grid, in what everything but bank and network takes for one of the
picture (measured in CPU-seconds: 0.018 of 0.22)."""
GRADIENT_SHARE: Final = 0.06
"""The gradient, likewise."""


def check(entry: LenslessAdmm, manifest: Manifest, max_bytes: int) -> None:
    """Refuse a frame that does not fit.

    Raises:
        ContractError: If it takes more memory than there is.
    """
    extent = manifest.sensor.extent
    if extent is None:
        return
    # kernels are about as wide as the frame
    sides = extent.height_px, extent.width_px
    least = solver_bytes(entry, sides, sides)
    if least > max_bytes:
        raise ContractError(
            f"the scene of {manifest.name} takes about {least // 10**6} MB to be found; got "
            f"{max_bytes // 10**6} MB: raise {option_text('max_mem_bytes')}"
        )


def solver_bytes(entry: LenslessAdmm, size_px: tuple[int, ...], kernel_px: tuple[int, ...]) -> int:
    """Return the memory in which one channel is sought."""
    rows, columns = grid_of(size_px, kernel_px)
    return 4 * rows * columns * (PLANES + (GRADIENT_PLANES if entry.tv else 0))


def prepare(entry: LenslessAdmm, job: Job) -> StageWork:
    """Return what the scene takes."""
    found: list[float] = []

    def run(taken: Sequence[Stream]) -> tuple[Stream, ...]:
        return (taken[0].with_bands(_bands(entry, job, taken[0], found)),)

    def warnings() -> tuple[str, ...]:
        said = "the scene explains the capture but for {:.2%} of it"
        return tuple(said.format(residual) for residual in found[-1:])

    capture, psf = job.capture, job.known_bundle.psf
    size_px = capture.height, capture.width
    held = 4 * 3 * capture.channels * capture.height * capture.width
    return StageWork(
        run=run,
        held_bytes=held,
        first_bytes=held + solver_bytes(entry, size_px, psf.kernels.shape[-2:]),
        warnings=warnings,
    )


def seconds(entry: LenslessAdmm, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    size_px = subject.height_px, subject.width_px
    rows, columns = grid_of(size_px, subject.bundle.psf.kernels.shape[-2:])
    share = ROUND_SHARE + (GRADIENT_SHARE if entry.tv else 0.0)
    channels = len(subject.bundle.manifest.sensor.channels)
    rounds = entry.iterations * channels * rows * columns / 1e6
    return share * rounds * speed.rest_s_per_mp


def _bands(entry: LenslessAdmm, job: Job, taken: Stream, found: list[float]) -> Iterator[Rows]:
    """Yield the rows of the scene; seeks it when the first is asked for."""
    source = taken.rows()
    capture = source.read(0, source.shape[1])
    scenes = [
        solve(plane, kernel, _settings(entry), threads=job.threads, rounds=_rounds(entry, job, at))
        for at, (plane, kernel) in enumerate(zip(capture, _kernels(job), strict=True))
    ]
    picture = np.stack([solved.scene[solved.window] for solved in scenes]) / np.float32(entry.white)
    found.append(max(solved.residual for solved in scenes))
    job.log.sections[SECTION] = {
        "iterations": entry.iterations,
        "residual": [round(solved.residual, 6) for solved in scenes],
        "scene_px": list(scenes[0].scene.shape[::-1]),
        "light_beside_frame": [round(_beside(solved), 6) for solved in scenes],
    }
    del scenes, capture
    for band in read_bands(ArrayRows(picture)):
        yield band.copy()


def _settings(entry: LenslessAdmm) -> Settings:
    return Settings(**entry.model_dump(include=set(Settings.__dataclass_fields__)))


def _rounds(entry: LenslessAdmm, job: Job, channel: int) -> Iterator[None]:
    """Yield once for every round: each is counted, and ends if the caller wants to stop."""
    for number in range(entry.iterations):
        share = (channel + number / entry.iterations) / job.capture.channels
        job.log.meter.reach(entry.gives[0], share)
        yield


def _kernels(job: Job) -> FloatArray:
    """Return (channel, h, w), at the distance of the scene if that is given."""
    bundle, depth_mm = job.known_bundle, job.options.depth_mm
    sensor = bundle.manifest.sensor
    assert sensor.type != "spad"  # its counts never join
    kernels = color_kernels(bundle.psf, *sensor.response_arrays(), depth_mm=depth_mm)
    found: FloatArray = kernels.scaled(job.placement.kernel_scale).kernels[0]
    return found


def _beside(solved: Solved) -> float:
    """Return the share of the scene's light that comes from beside the frame."""
    total = float(solved.scene.sum(dtype=np.float64))
    inside = float(solved.scene[solved.window].sum(dtype=np.float64))
    return 1 - inside / total if total else 0.0
