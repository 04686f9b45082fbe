"""A capture of a row's camera to the picture of the row."""

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.sensor import BayerSensor
from camkit.export.assemble import export_bundle
from camkit.export.parts import Parts
from camkit.models_def.kinds.hdr.samples import develop
from camkit.models_def.kinds.hdr.thesis.networks import to_light, to_roots
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.report.hdr_score import blob_guess
from camkit.report.kinds.hdr.capture import capture_of
from camkit.report.quality import Exposed
from camkit.report.sensor_geometry import in_sensor_geometry
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.truth import true_picture
from camkit.scenes.saturation import CEILING
from tools.tables.equal_training import checkpoint_of
from tools.tables.table_rows import Run

NETWORK: Final = "net"

Restorer = Callable[[Exposed], FloatArray]
"""A capture with its truth -> (3, h, w) linear Rec.709."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A camera of the tables.

    Attributes:
        bundle: Without a network.
        frozen: File of its optics.
    """

    bundle: Bundle
    frozen: Path


def make_restorer(run: Run, camera: Camera, runs: Path) -> Restorer:
    """Return what makes the pictures of a row.

    Args:
        run: The row and its seed.
        camera: Of its plate.
        runs: Folder of trainings; receives the bundles of networks.
    """
    match run.row.method:
        case "input":
            return lambda exposed: np.asarray(exposed.extras["input"])
        case "guess":
            return lambda exposed: blob_guess(exposed.extras["input"], exposed.extras["clipped"])
        case "physics":
            return _by_pipeline(camera.bundle, "physics")
        case "network":
            return _by_pipeline(_packed(run, camera, runs), NETWORK)
        case _:
            checkpoint = read_checkpoint(checkpoint_of(runs, run))
            return _by_network(load_network(checkpoint), camera.bundle)


def timed(restore: Restorer, exposed: Exposed) -> tuple[FloatArray, float]:
    """Return the picture of a row, and the CPU-seconds that it took."""
    start = time.process_time()
    picture = restore(exposed)
    return picture, time.process_time() - start


def _packed(run: Run, camera: Camera, runs: Path) -> Bundle:
    """Return the bundle of a network as it would ship, made once of a checkpoint and its optics."""
    checkpoint = checkpoint_of(runs, run)
    content = checkpoint.read_bytes() + camera.frozen.read_bytes()
    out = runs / run.name / f"{hashlib.sha256(content).hexdigest()[:16]}.camkit"
    if not out.is_file():
        # the plate of `dual-peak` is not quite that of its streaks
        parts = Parts(checkpoints=(checkpoint,), psf=camera.frozen, without_plate=True)
        export_bundle(parts, out)
    return open_bundle(out)


def _by_pipeline(bundle: Bundle, method: str) -> Restorer:
    options: dict[str, Any] = {"method": method, **in_sensor_geometry(bundle.manifest)}
    pipeline = Pipeline(bundle, Options(threads=1, **options))
    return lambda exposed: pipeline.start(capture_of(pipeline, exposed.simulation)).fill()


def _by_network(network: nn.Module, bundle: Bundle) -> Restorer:
    sensor = bundle.manifest.sensor
    assert isinstance(sensor, BayerSensor)  # as all cameras of the tables

    def restore(exposed: Exposed) -> FloatArray:
        samples, gains = exposed.simulation.samples, exposed.simulation.white_balance
        red, green, blue = gains
        planes = develop(_raw(samples, sensor), (red, green, blue), sensor.cfa)
        with torch.no_grad():
            output = whole_frame(network, to_roots(torch.from_numpy(planes)[None]))
        light = to_light(output).clamp(max=CEILING)
        return true_picture(np.ascontiguousarray(light[0].numpy()), sensor)

    return restore


def _raw(samples: NDArray[Any], sensor: BayerSensor) -> FloatArray:
    """Return a capture as networks see it in training: black 0, white 1."""
    levels = np.float32(sensor.white_level - sensor.black_level)
    return (samples.astype(np.float32) - np.float32(sensor.black_level)) / levels


def whole_frame(network: nn.Module, planes: Tensor) -> Tensor:
    """Run a network on (1, c, h, w) planes of any size; they go on as their border does."""
    stride: Any = network.stride_px
    height, width = planes.shape[-2:]
    more = (0, -width % stride, 0, -height % stride)
    output: Tensor = network(nn.functional.pad(planes, more, mode="replicate"))
    return output[..., :height, :width]
