"""Jobs and stages on their own: what is known of a capture, and a stage run on planes in memory."""

from typing import Any

import numpy as np

from camkit.bundle.plane import Domain, Plane
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import MOSAIC, RGB
from camkit.bundle.stages import Stage
from camkit.runtime.capture import Capture
from camkit.runtime.job.job import Job
from camkit.runtime.job.photograph import looked_at
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.job.stream import Stream
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.rows import ArrayRows, Rows, RowSource
from camkit.runtime.stage_finder import stage_module

OWN_BALANCE = (2.0, 1.0, 1.5)
OWN_MATRIX = np.diag([0.8, 1.0, 0.6])
SHAPE = (64, 96)


def made_mosaic(**facts: object) -> Capture:
    """Give a capture of the tiny camera that states everything."""
    rng = np.random.default_rng(3)
    sound = {
        "samples": rng.integers(100, 900, SHAPE, dtype=np.uint16),
        "cfa": "RGGB",
        "black_level": np.full((2, 2), 64, np.float32),
        "white_level": 1023.0,
        "white_balance": OWN_BALANCE,
        "color_matrix": OWN_MATRIX,
        "iso": 100.0,
    }
    return Capture(**(sound | facts))  # type: ignore[arg-type]


def made_planes(**facts: object) -> Capture:
    """Give a linear picture that states nothing but its levels."""
    samples = facts.get("samples", np.full((3, *SHAPE), 0.3, np.float32))
    assert isinstance(samples, np.ndarray)
    plain = {
        "samples": samples,
        "cfa": None,
        "black_level": np.zeros(samples.shape[0], np.float32),
        "white_level": 1.0,
        "iso": 100.0,
    }
    return Capture(**(plain | facts))  # type: ignore[arg-type]


def start(bundle: Bundle | None, capture: Capture, **choices: Any) -> Reconstruction:
    """Plan a capture."""
    return Pipeline(bundle, Options(**choices)).start(capture)


def made_job(
    capture: Capture, bundle: Bundle | None = None, *, threads: int = 1, **choices: Any
) -> Job:
    """Give what is known of a capture before any stage is prepared."""
    return Pipeline(bundle, Options(threads=threads, **choices)).start(capture).job


def stream_of(
    rows: Rows | RowSource,
    domain: Domain = "linear",
    *,
    gains: tuple[float, ...] | None = None,
    owned: bool = False,
) -> Stream:
    """Give planes as a stage takes them."""
    source = ArrayRows(rows) if isinstance(rows, np.ndarray) else rows
    count = source.shape[0]
    names = {1: MOSAIC, 3: RGB}.get(count) or tuple(f"c{i}" for i in range(count))
    kind = {"mask": "bool", "dn": "uint16"}.get(domain, "float32")
    plane = Plane.model_validate({"type": kind, "channels": names, "domain": domain})
    return Stream(
        plane=plane,
        shape=source.shape,
        gains=gains or (1.0,) * max(count, 3),
        source=source,
        owned=owned,
    )


def captured(capture: Capture) -> Stream:
    """Give the samples of a capture as the walker hands them to the first stage."""
    return stream_of(capture.samples.reshape(capture.plane_shape), "dn")


def run_stage(entry: Stage, job: Job, *taken: Stream) -> tuple[Stream, ...]:
    """Give what a stage makes of planes."""
    job = looked_at(job, [entry])
    made: tuple[Stream, ...] = stage_module(entry.type).prepare(entry, job).run(taken)
    return made


def read_all(source: RowSource, step: int | None = None) -> Rows:
    """Read a source from top to bottom, `step` rows at a time."""
    height = source.shape[1]
    tops = range(0, height, step or height)
    parts = [source.read(top, min(top + (step or height), height)) for top in tops]
    return np.concatenate([part.copy() for part in parts], axis=1)
