"""Rows of CPU seconds: what one thread takes for a frame, light in flight, and a cube of depth.

frame        counts of the array -> a picture on the fine grid
transient    all time bins of a histogram, one by one
depth        the bins made finer, then fitted
depth_cube   a file of a histogram -> all files of its depth by `camkit process`, in a process of
             its own, by the method that it chooses: start-up, reading and writing are in, and
             peak memory is told
"""

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Sharpen
from camkit.report.bench.timed.process_run import Job, run_job
from camkit.report.bench.trial import Skip
from camkit.report.kinds.spad.scenes import drawn_pictures
from camkit.runtime.kinds.spad.captures.bundle_times import times_of_bundle
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.depth import FineSharpener
from camkit.runtime.kinds.spad.finer.pictures import finer_frames
from camkit.runtime.kinds.spad.golden_captures import stage_set
from camkit.runtime.kinds.spad.sharpen import Way
from camkit.runtime.kinds.spad.twin.counting import Disturbances, count_times, scaled_to
from camkit.runtime.kinds.spad.twin.photon_twin import seen_by, times_of
from camkit.runtime.kinds.spad.twin.recording import Recorded
from camkit.runtime.kinds.spad.twin.scene import light_of_depth
from camkit.runtime.kinds.spad.twin.write import write_recorded

PHOTONS: Final = 1000.0
"""Of white in the frame; of a pixel, in all bins, in the histogram."""
FRAMES: Final = 20
"""Frames whose seconds are taken together: one alone is too short to be told."""
SEED: Final = 50
DEFAULT_METHOD: Final = "default"
"""Method of a process that is not told any."""

Do = Callable[[], object]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Timed:
    """Captures whose work is timed.

    Attributes:
        frame: (h, w) counts.
        histogram: (bins, h, w) counts; None of an array without time bins.
    """

    frame: FloatArray
    histogram: NDArray[np.uint32] | None


def timed_captures(camera: FineCamera) -> Timed:
    """Simulate the captures of a procedural scene."""
    (picture,) = drawn_pictures(camera, 1)
    rng = np.random.default_rng(SEED)
    light = np.maximum(seen_by(camera, picture[None])[0], 0)
    frame = rng.poisson(light * PHOTONS).astype(np.float32)
    if camera.sensor.time_bins == 0 or camera.bundle.manifest.stage(Sharpen) is None:
        return Timed(frame=frame, histogram=None)
    axis, pulse = times_of(camera)
    scene = light_of_depth(stage_set(camera, SEED), picture, axis, pulse)
    mean = scaled_to(seen_by(camera, scene), PHOTONS)
    return Timed(frame=frame, histogram=count_times(mean, axis.orientation, Disturbances(), rng))


def seconds_rows(
    bundle: Bundle, sizes: Sequence[str], repeat: int, tell: Callable[[str], None]
) -> Iterator[dict[str, Any] | Skip]:
    """Measure the time of all work by one thread, linearly and by every size of network.

    Args:
        bundle: The camera.
        sizes: Of its networks.
        repeat: How often; the median is told.
        tell: Called with what begins.
    """
    camera = FineCamera.of(bundle, threads=1)
    captures = timed_captures(camera)
    for size in (None, *sizes):
        tell(f"seconds, {size or 'linear'}")
        for what, do, times in _work(camera, captures, size):
            cpu_s = _median_cpu_s(do, times, repeat)
            yield _row(what, "linear" if size is None else "net", size, cpu_seconds=cpu_s)
    if captures.histogram is not None:
        tell("seconds of a process")
        yield _process_row(camera, captures.histogram, repeat)


def _work(camera: FineCamera, captures: Timed, size: str | None) -> Iterator[tuple[str, Do, int]]:
    frame = captures.frame[None]
    yield "frame", lambda: finer_frames(camera, frame, 0.0, size), FRAMES
    if captures.histogram is None:
        return
    histogram = captures.histogram.astype(np.float32)
    yield "transient", lambda: finer_frames(camera, histogram, 0.0, size), 1
    counts = np.ascontiguousarray(histogram.transpose(1, 2, 0))
    axis, pulse = times_of(camera)
    shape = counts.shape[:2]
    nothing = np.zeros(shape, dtype=bool)

    def depth() -> object:
        fine = FineSharpener(camera, axis, pulse, Way(), size=size, always=True)
        return fine.cube(counts, np.zeros(shape), hot=nothing, blind=nothing)

    yield "depth", depth, 1


def _median_cpu_s(do: Do, times: int, repeat: int) -> float:
    """Return the processor time of doing something once, when all is warm."""
    do()
    seconds = []
    for _ in range(repeat):
        began = time.process_time()
        for _ in range(times):
            do()
        seconds.append((time.process_time() - began) / times)
    return statistics.median(seconds)


def _process_row(
    camera: FineCamera, histogram: NDArray[np.uint32], repeat: int
) -> dict[str, Any] | Skip:
    with tempfile.TemporaryDirectory(prefix="camkit-bench-") as name:
        folder = Path(name)
        cube = folder / "cube.npz"
        times = times_of_bundle(camera.bundle.manifest)
        write_recorded(cube, Recorded(name="histogram", values=histogram, attributes=times))
        job = Job(
            files=(cube,),
            bundle=str(camera.bundle.path.resolve()),
            out_dir=folder / "out",
            options={"threads": 1},
        )
        runs = [run_job(job) for _ in range(repeat)]
    failed = next((run.error for run in runs if run.error is not None), None)
    if failed is not None:
        return Skip(what="seconds of a process", reason=failed)
    return _row(
        "depth_cube",
        DEFAULT_METHOD,
        None,
        cpu_seconds=statistics.median(run.cpu_s or 0.0 for run in runs),
        seconds=round(statistics.median(run.seconds or 0.0 for run in runs), 4),
        peak_rss_mb=round(max(run.peak_rss_mb or 0.0 for run in runs), 1),
    )


def _row(
    what: str, method: str, size: str | None, *, cpu_seconds: float, **more: float
) -> dict[str, Any]:
    return {
        "sort": "seconds",
        "what": what,
        "method": method,
        "size": size,
        "threads": 1,
        "cpu_seconds": round(cpu_seconds, 5),
        **more,
    }
