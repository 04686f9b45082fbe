"""Lanczos or cubic undistortion: seconds of either, and what cubic loses of restored pictures.

    python -m tools.plan.undistortion --data PICTURES -o docs/results/undistortion.json

Seconds are CPU seconds of one thread per megapixel, of bands of a picture of the sensor's width, in
turns; medians. Losses: the middle of every picture, photographed half-way to the corner of the
sensor at ISO 100 and restored by the bundle, undistorted in both ways and held against the ideal
picture (its undistortion by Lanczos): PSNR on sRGB values, lanczos less cubic.
"""

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.stages import Undistort
from camkit.bundle.stages.undistort import Interpolation
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.report.bench.machine import describe_machine
from camkit.report.quality import crop_origin, read_picture
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.rows import ArrayRows
from camkit.runtime.twin.simulate import SimulationOptions, photograph
from camkit.runtime.twin.truth import ideal_picture
from tools.capture.simulated import captured, color_sensor
from tools.comparison.compact_json import to_compact_json

WAYS: Final[tuple[Interpolation, ...]] = ("lanczos", "cubic")
TIMED_ROWS: Final = 1024
SIDE_PX: Final = 512
SHARE: Final = 0.5
BORDER_PX: Final = 32
ISO: Final = 100.0
DIGITS: Final = 5


def main(words: Sequence[str] | None = None) -> None:
    """Measure and write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", default="duet", help="NAME or PATH")
    parser.add_argument("--data", type=Path, required=True, help="folder of sharp pictures")
    parser.add_argument("--pictures", type=int, default=12, help="of them, at most")
    parser.add_argument("--size", default="S", help="of the network")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words)
    bundle = open_bundle(find_bundle(arguments.bundle))
    kinds = {".png", ".jpg", ".jpeg"}
    paths = sorted(p for p in arguments.data.iterdir() if p.suffix.lower() in kinds)
    losses = [loss_db(bundle, path, arguments.size) for path in paths[: arguments.pictures]]
    record = {
        "machine": describe_machine(),
        "bundle": bundle.manifest.name,
        "cpu_s_per_mp": cpu_seconds(bundle, arguments.repeat),
        "loss_db": {"mean": statistics.fmean(losses), "most": max(losses), "pictures": len(losses)},
    }
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")
    print(json.dumps(record))


def cpu_seconds(bundle: Bundle, repeat: int) -> dict[str, float]:
    """Give way -> CPU seconds of a megapixel."""
    sensor = color_sensor(bundle)
    size = sensor.width_px, min(TIMED_ROWS, sensor.height_px)
    window = SensorWindow(
        size_px=size,
        origin_px=(0, 0),
        sensor_size_px=(sensor.width_px, sensor.height_px),
        pitch_um=sensor.pixel_pitch_um,
    )
    picture = np.random.default_rng(0).random((3, size[1], size[0]), dtype=np.float32)
    found: dict[str, list[float]] = {way: [] for way in WAYS}
    for _ in range(repeat):
        for way in WAYS:
            began = time.process_time()
            bands = undistort_bands(
                ArrayRows(picture), bundle.psf.distortion, window, interpolation=way
            )
            for _band in bands:
                pass
            found[way].append((time.process_time() - began) / (size[0] * size[1] / 1e6))
    return {way: statistics.median(values) for way, values in found.items()}


def loss_db(bundle: Bundle, path: Path, size: str) -> float:
    """Give what cubic interpolation loses of a restored picture."""
    picture, sensor = read_picture(path), color_sensor(bundle)
    height = min(SIDE_PX, picture.shape[1], sensor.height_px)
    width = min(SIDE_PX, picture.shape[2], sensor.width_px)
    top, left = (picture.shape[1] - height) // 2, (picture.shape[2] - width) // 2
    scene = picture[:, top : top + height, left : left + width]
    origin = crop_origin((width, height), (sensor.width_px, sensor.height_px), SHARE, (1, 1))
    options = SimulationOptions(iso=ISO, origin_px=origin)
    taken = photograph(scene, bundle, options)
    truth = ideal_picture(taken, bundle)
    psnr = [_psnr_db(_made(_with(bundle, way), taken, size), truth) for way in WAYS]
    return psnr[0] - psnr[1]


def _with(bundle: Bundle, way: Interpolation) -> Bundle:
    stages = tuple(
        stage.model_copy(update={"interpolation": way}) if isinstance(stage, Undistort) else stage
        for stage in bundle.manifest.stages
    )
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"stages": stages}))


def _made(bundle: Bundle, taken: Any, size: str) -> FloatArray:
    pipeline = Pipeline(bundle, Options(size=size, vignetting=True, threads=1))
    return pipeline.start(captured(pipeline, taken)).fill()


def _psnr_db(picture: FloatArray, truth: FloatArray) -> float:
    inside = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    made, true = (encode_srgb(np.clip(p[inside], 0, 1)) for p in (picture, truth))
    return float(-10 * np.log10(np.mean(np.square(made - true, dtype=np.float64)) + 1e-12))


if __name__ == "__main__":
    main()
