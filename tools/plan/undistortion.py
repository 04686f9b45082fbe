"""Ways of undistortion: seconds of each, what it loses of restored pictures, rings around lamps.

    python -m tools.plan.undistortion --data PICTURES -o docs/results/undistortion.json

Seconds are CPU seconds of one thread per megapixel, of bands of a picture of the sensor's width, in
turns; medians (`cubic_limited`: cubic with limited overshoot), and of a night of lamps. Losses: the
middle of every picture, photographed half-way to the corner of the sensor at ISO 100 and restored
by the bundle, undistorted in every way and held against the ideal picture (its undistortion by
Lanczos): PSNR on sRGB values, lanczos less the way. Rings: nights photographed in the middle of the
sensor, 0.5 % of them saturated; the darkest value and the pixels below -0.05, in camera colours.
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
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.report.bench.machine import describe_machine
from camkit.report.quality import crop_origin, read_picture
from camkit.runtime.color import OutputColor
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.rows import ArrayRows
from camkit.runtime.twin.saturation import exposure_for_share
from camkit.runtime.twin.simulate import SimulationOptions, photograph
from camkit.runtime.twin.truth import ideal_picture
from camkit.scenes.saturation import with_exposure
from camkit.scenes.scene_register import named_scene
from tools.capture.simulated import captured, color_sensor
from tools.comparison.compact_json import to_compact_json

WAYS: Final = {
    "lanczos": Undistort(),
    "cubic": Undistort(interpolation="cubic"),
    "cubic_limited": Undistort(interpolation="cubic", overshoot="limited"),
}
TIMED_ROWS: Final = 1024
SIDE_PX: Final = 512
SHARE: Final = 0.5
BORDER_PX: Final = 32
ISO: Final = 100.0
NIGHTS: Final = ("night:0", "night:1", "night:2", "night:3")
NIGHT_PX: Final = (512, 768)
SATURATED: Final = 0.005
BLACK: Final = -0.05
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
    losses = [losses_db(bundle, path, arguments.size) for path in paths[: arguments.pictures]]
    dark = np.random.default_rng(0).random((3, *_timed_px(bundle)), dtype=np.float32)
    night = _exposed("night:3", _timed_px(bundle), bundle)
    record = {
        "machine": describe_machine(),
        "bundle": bundle.manifest.name,
        "cpu_s_per_mp": cpu_seconds(bundle, dark, arguments.repeat),
        "night_cpu_s_per_mp": cpu_seconds(bundle, night, arguments.repeat),
        "loss_db": {
            way: {"mean": statistics.fmean(each), "most": max(each), "pictures": len(each)}
            for way in WAYS
            if (each := [loss[way] for loss in losses])
        },
        "rings": {name: rings(bundle, name, arguments.size) for name in NIGHTS},
    }
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")
    print(json.dumps(record))


def _timed_px(bundle: Bundle) -> tuple[int, int]:
    """Return height and width of what is timed."""
    sensor = color_sensor(bundle)
    return min(TIMED_ROWS, sensor.height_px), sensor.width_px


def _exposed(name: str, size_px: tuple[int, int], bundle: Bundle) -> FloatArray:
    """Return a night of which a share saturates the camera."""
    scene = named_scene(name, *size_px)
    return with_exposure(scene, exposure_for_share(scene, color_sensor(bundle), SATURATED).exposure)


def cpu_seconds(bundle: Bundle, picture: FloatArray, repeat: int) -> dict[str, float]:
    """Return way -> CPU seconds of a megapixel."""
    sensor, (height, width) = color_sensor(bundle), picture.shape[1:]
    window = SensorWindow(
        size_px=(width, height),
        origin_px=(0, 0),
        sensor_size_px=(sensor.width_px, sensor.height_px),
        pitch_um=sensor.pixel_pitch_um,
    )
    found: dict[str, list[float]] = {way: [] for way in WAYS}
    for _ in range(repeat):
        for way, stage in WAYS.items():
            began = time.process_time()
            bands = undistort_bands(
                ArrayRows(picture),
                bundle.psf.distortion,
                window,
                interpolation=stage.interpolation,
                overshoot=stage.overshoot,
            )
            for _band in bands:
                pass
            found[way].append((time.process_time() - began) / (width * height / 1e6))
    return {way: statistics.median(values) for way, values in found.items()}


def losses_db(bundle: Bundle, path: Path, size: str) -> dict[str, float]:
    """Return way -> what it loses of a restored picture against Lanczos."""
    picture, sensor = read_picture(path), color_sensor(bundle)
    height = min(SIDE_PX, picture.shape[1], sensor.height_px)
    width = min(SIDE_PX, picture.shape[2], sensor.width_px)
    top, left = (picture.shape[1] - height) // 2, (picture.shape[2] - width) // 2
    scene = picture[:, top : top + height, left : left + width]
    origin = crop_origin((width, height), (sensor.width_px, sensor.height_px), SHARE, (1, 1))
    options = SimulationOptions(iso=ISO, origin_px=origin)
    taken = photograph(scene, bundle, options)
    truth = ideal_picture(taken, bundle)
    psnr = {way: _psnr_db(_made(_with(bundle, way), taken, size), truth) for way in WAYS}
    return {way: psnr["lanczos"] - value for way, value in psnr.items()}


def rings(bundle: Bundle, name: str, size: str) -> dict[str, dict[str, float]]:
    """Return way -> the darkest value of a night in camera colours, and pixels below black."""
    height, width = (
        min(side, most) for side, most in zip(NIGHT_PX, _timed_px(bundle), strict=True)
    )
    scene = _exposed(name, (height, width), bundle)
    taken = photograph(scene, bundle, SimulationOptions(iso=ISO))
    found = {}
    for way in WAYS:
        picture = _made(_with(bundle, way), taken, size, color="camera")
        below = int(np.count_nonzero(picture.min(axis=0) < BLACK))
        found[way] = {"darkest": float(picture.min()), "below_black_px": below}
    return found


def _with(bundle: Bundle, way: str) -> Bundle:
    chosen = WAYS[way]
    update = {"interpolation": chosen.interpolation, "overshoot": chosen.overshoot}
    stages = tuple(
        stage.model_copy(update=update) if isinstance(stage, Undistort) else stage
        for stage in bundle.manifest.stages
    )
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"stages": stages}))


def _made(bundle: Bundle, taken: Any, size: str, *, color: OutputColor = "rec709") -> FloatArray:
    pipeline = Pipeline(bundle, Options(size=size, color=color, threads=1))
    return pipeline.start(captured(pipeline, taken)).fill()


def _psnr_db(picture: FloatArray, truth: FloatArray) -> float:
    inside = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    made, true = (encode_srgb(np.clip(p[inside], 0, 1)) for p in (picture, truth))
    return float(-10 * np.log10(np.mean(np.square(made - true, dtype=np.float64)) + 1e-12))


if __name__ == "__main__":
    main()
