"""The main job, end to end: photograph a scene with `duet`, process the DNG, show what it gained.

    python -m tools.demo --out-dir out

leaves demo.dng, demo.exr, demo.png, their sidecars, and before_after.png.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import camkit
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.sensor import BayerSensor
from camkit.colorimetry import apply_matrix, encode_srgb
from camkit.contracts import FloatArray
from camkit.runtime.geometry.illumination import divide_illumination
from camkit.runtime.network.engine import available_threads
from camkit.runtime.signal.demosaic import demosaic
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, simulate, write_capture
from camkit.scenes import procedural_scene
from tools.capture.simulated import rec709_of

CROP_PX = 512
BORDER_PX = 32
EXPOSURE = 0.5
FIELDS = (0.0, 0.25, 0.5, 0.75, 0.95)


def main() -> None:
    """Run the demo."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out-dir", type=Path, default=Path("out"))
    parser.add_argument("--bundle", default="duet")
    parser.add_argument("--iso", type=float, default=100.0)
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    out_dir: Path = arguments.out_dir
    out_dir.mkdir(parents=True, exist_ok=True)

    bundle = open_bundle(find_bundle(arguments.bundle))
    sensor = _mosaic_sensor(bundle)
    print("photographing a 24-megapixel scene (about a minute) ...", flush=True)
    began = time.perf_counter()
    scene = procedural_scene(arguments.seed, sensor.height_px, sensor.width_px)
    simulation = simulate(
        scene,
        sensor,
        bundle.psf,
        SimulationOptions(
            iso=arguments.iso,
            seed=1,
            exposure=EXPOSURE,
            workers=available_threads(None),
        ),
    )
    del scene
    capture = out_dir / "demo.dng"
    write_capture(capture, simulation, sensor, bundle.manifest.name)
    print(f"{capture}: photographed in {time.perf_counter() - began:.1f} s")

    plan = ("plan", str(capture), "--bundle", arguments.bundle)
    subprocess.run([sys.executable, "-m", "camkit", *plan], check=True)
    for suffix in ("exr", "png"):
        _process(capture, arguments.bundle, out_dir, suffix)
    _show_quality(simulation, arguments.bundle, arguments.iso, out_dir / "before_after.png")


def _mosaic_sensor(bundle: Bundle) -> BayerSensor:
    sensor = bundle.manifest.sensor
    if not isinstance(sensor, BayerSensor):
        raise SystemExit(f"{bundle.manifest.name} has no mosaic; the demo shows cameras with one")
    return sensor


def _process(capture: Path, bundle: str, out_dir: Path, suffix: str) -> None:
    """Run the command in a process of its own, so that its memory is its own."""
    print(f"{capture}: processing to {suffix} ...", flush=True)
    command = [
        *(sys.executable, "-m", "camkit", "process", str(capture), "--bundle", bundle),
        *("--out-dir", str(out_dir), "--format", suffix, "--overwrite", "--json"),
    ]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    result = json.loads(done.stdout or "{}")
    if result.get("status") != "ok":
        raise SystemExit(f"{capture}: {result.get('error', 'no answer')}")
    seconds = result["seconds"]
    print(f"{result['output']}: {sum(seconds.values()):.1f} s, {result['peak_rss_mb']:.0f} MB")
    print("  " + ", ".join(f"{name} {value:.2f} s" for name, value in seconds.items()))
    for warning in result["warnings"]:
        print(f"  note: {warning}")


def _show_quality(simulation: Simulation, name: str, iso: float, picture: Path) -> None:
    """Compare crops from axis to corner with the sharp scene, in sensor geometry."""
    bundle = open_bundle(find_bundle(name))
    matrix = rec709_of(_mosaic_sensor(bundle))
    methods = {
        "wiener": camkit.load(name, method="wiener", undistort=False),
        "net M": camkit.load(name, undistort=False),
    }
    height, width = simulation.samples.shape
    red, green, blue = simulation.white_balance
    rows = []
    print("\nPSNR in dB on sRGB values, sensor geometry, 512-px crops from axis to corner")
    print("field   " + "".join(f"{label:>10}" for label in ("input", *methods)))
    for field in FIELDS:
        x = int((width / 2 - CROP_PX) * field + (width - CROP_PX) / 2) // 2 * 2
        y = int((height / 2 - CROP_PX) * field + (height - CROP_PX) / 2) // 2 * 2
        x, y = min(x, width - CROP_PX) // 2 * 2, min(y, height - CROP_PX) // 2 * 2
        cut = np.s_[..., y : y + CROP_PX, x : x + CROP_PX]
        sharp = encode_srgb(apply_matrix(matrix, simulation.clean[cut]))
        mosaic = np.ascontiguousarray(simulation.samples[cut])
        tiles = [encode_srgb(_seen(mosaic, simulation, bundle, x, y))]
        for pipeline in methods.values():
            image = pipeline.process_array(
                mosaic, iso=iso, white_balance=(red, green, blue), origin_px=(x, y)
            )
            tiles.append(encode_srgb(image))
        print(f"{field:5.2f}   " + "".join(f"{_psnr(t, sharp):10.2f}" for t in tiles))
        rows.append(np.concatenate([*tiles, sharp], axis=2))
    sheet = np.concatenate(rows, axis=1).transpose(1, 2, 0)[..., ::-1]
    cv2.imwrite(str(picture), (np.clip(sheet, 0, 1) * 255 + 0.5).astype(np.uint8))
    print(f"\n{picture}: before, Wiener bank, network, sharp scene; one row per field position")


def _seen(
    mosaic: NDArray[np.uint16], simulation: Simulation, bundle: Bundle, x: int, y: int
) -> FloatArray:
    """Give a crop demosaicked, white-balanced and without vignetting: what the lens saw."""
    sensor = _mosaic_sensor(bundle)
    window = replace(simulation.window, size_px=(CROP_PX, CROP_PX), origin_px=(float(x), float(y)))
    signal = mosaic.astype(np.float32) - np.float32(sensor.black_level)
    signal /= np.float32(sensor.white_level - sensor.black_level)
    planes = demosaic(signal, sensor.cfa)
    planes *= np.array(simulation.white_balance, np.float32)[:, None, None]
    planes = divide_illumination(planes, 0, bundle.psf, window)
    return apply_matrix(rec709_of(sensor), planes)


def _psnr(image: FloatArray, sharp: FloatArray) -> float:
    inside = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    error = float(np.mean((np.clip(image, 0, 1)[inside] - sharp[inside]) ** 2))
    return float(-10 * np.log10(max(error, 1e-12)))


if __name__ == "__main__":
    main()
