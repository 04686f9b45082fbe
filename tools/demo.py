"""The main job, end to end: photograph two scenes with `duet`, process the DNGs, show the gain.

    python -m tools.demo --out-dir out

A photograph lies half way out; confetti fills a quarter of the sensor, from the axis to a corner.
Leaves photo.dng and .png, confetti.dng and .exr, their sidecars, and before_after.png: crops at
100 % with captions, as developed, behind the filter, behind the network, and the truth.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import camkit
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.sensor import BayerSensor
from camkit.colorimetry import apply_matrix, encode_srgb
from camkit.contracts import FloatArray
from camkit.runtime.files.picture import read_scene
from camkit.runtime.geometry.illumination import divide_illumination
from camkit.runtime.network.engine import available_threads
from camkit.runtime.signal.demosaic import demosaic
from camkit.runtime.twin.simulate import (
    Simulation,
    SimulationOptions,
    photograph,
    write_capture,
)
from camkit.scenes import procedural_scene
from tools.capture.simulated import rec709_of
from tools.pictures.captions import write_captioned

CROP_PX = 384
MARGIN_PX = 96
"""Margin that is processed around a crop: its borders look as in the whole picture then."""
DETAIL = 3
DETAIL_AT = (0.56, 0.5)
"""Top and left of what is shown `DETAIL` times as large, as shares of the photograph's crop."""
BORDER_PX = 32
EXPOSURE = 0.5
FIELDS = (0.0, 0.25, 0.5, 0.75, 0.95)
PHOTO = Path(__file__).parent / "scenes" / "coffee.png"
"""600x400, by Rachel Michetti, CC0; see scenes/README.md."""
TITLES = {
    "photo": "A photograph (Rachel Michetti, CC0), crop at 100 %",
    "confetti": "Synthetic confetti, crop at 100 %",
}
HEADING = (
    "{bundle.name} {bundle.version}, ISO {iso:g}: what the lens gives and what camkit makes of it\n"
    "Simulated captures. developed: as the lens saw it; filter: Wiener, without the network; "
    "truth: the sharp scene.\nPSNR in dB of sRGB values against the truth, before undistortion."
)


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
    began = time.perf_counter()
    print("photographing two scenes ...", flush=True)

    bundle = open_bundle(find_bundle(arguments.bundle))
    sensor = _mosaic_sensor(bundle)
    width, height = sensor.width_px // 4 * 2, sensor.height_px // 4 * 2
    confetti = procedural_scene(arguments.seed, height, width)
    photo = read_scene(PHOTO)
    half_way = (width * 3 - photo.shape[2]) // 2, (height * 3 - photo.shape[1]) // 2
    taken = {
        "confetti": _photograph(confetti, bundle, (width, height), arguments.iso),
        "photo": _photograph(photo, bundle, half_way, arguments.iso),
    }
    for name, simulation in taken.items():
        write_capture(out_dir / f"{name}.dng", simulation, sensor, bundle.manifest.name)
        shape = "x".join(map(str, simulation.samples.shape[::-1]))
        print(f"{out_dir / name}.dng: {shape} at {simulation.window.origin_px}")
    print(f"photographed in {time.perf_counter() - began:.1f} s\n", flush=True)

    plan = ("plan", str(out_dir / "confetti.dng"), "--bundle", arguments.bundle)
    subprocess.run([sys.executable, "-m", "camkit", *plan], check=True)
    print(flush=True)
    for name, suffix in (("confetti", "exr"), ("photo", "png")):
        _process(out_dir / f"{name}.dng", arguments.bundle, out_dir, suffix)
    picture = out_dir / "before_after.png"
    _show_quality(taken, arguments.bundle, arguments.iso, picture)
    print(f"all of it in {time.perf_counter() - began:.0f} s")
    print(f"Open {picture} first.")


def _photograph(
    scene: FloatArray, bundle: Bundle, origin_px: tuple[int, int], iso: float
) -> Simulation:
    options = SimulationOptions(
        iso=iso,
        seed=1,
        exposure=EXPOSURE,
        origin_px=(origin_px[0] // 2 * 2, origin_px[1] // 2 * 2),
        workers=available_threads(None),
    )
    return photograph(scene, bundle, options)


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


def _show_quality(taken: dict[str, Simulation], name: str, iso: float, picture: Path) -> None:
    """Compare crops with the sharp scenes, in sensor geometry."""
    bundle = open_bundle(find_bundle(name))
    network = camkit.load(name, undistort=False)
    methods = {
        "filter": camkit.load(name, method="wiener", undistort=False),
        f"network {network.size}": network,
    }
    heads = ("developed", *methods)
    print("comparing crops with the sharp scenes ...", flush=True)
    print("\nPSNR in dB against the sharp scene, on sRGB values, before undistortion")
    print(f"{'scene':<10}{'distance from axis':<20}" + "".join(f"{head:>10}" for head in heads))
    print(f"{'':<10}{'share of half field':<20}" + f"{'dB':>10}" * len(heads))
    rows: dict[str, dict[str, FloatArray]] = {}
    for scene, field in (("photo", 0.5), *(("confetti", field) for field in FIELDS)):
        simulation = taken[scene]
        height, width = simulation.samples.shape
        # the photograph lies half way out, and its middle is shown
        x, y = (int((side - CROP_PX) * field) // 2 * 2 for side in (width, height))
        *made, sharp = _crop(simulation, bundle, methods, (x, y), iso)
        decibels = [_psnr(tile, sharp) for tile in made]
        print(f"{scene:<10}{field:<20.2f}" + "".join(f"{value:10.2f}" for value in decibels))
        captions = [f"{head}: {value:.2f} dB" for head, value in zip(heads, decibels, strict=True)]
        tiles = dict(zip((*captions, "truth"), (*made, sharp), strict=True))
        place = f"{100 * field:.0f} % of the way from the axis to the corner"
        rows[f"{TITLES[scene]}, {place}"] = tiles
        if scene == "photo":
            enlarged = zip((*heads, "truth"), map(_detail, tiles.values()), strict=True)
            rows[f"Part of the same, {DETAIL} times as large"] = dict(enlarged)
    write_captioned(picture, HEADING.format(bundle=bundle.manifest, iso=iso), rows)
    print(f"\n{picture}: columns {', '.join(heads)}, truth; rows as in the table")


def _detail(tile: FloatArray) -> FloatArray:
    """Return a part of a square crop, enlarged to its size; pixels stay squares."""
    side = tile.shape[1] // DETAIL
    top, left = (int(share * tile.shape[1]) for share in DETAIL_AT)
    part = tile[:, top : top + side, left : left + side]
    return part.repeat(DETAIL, axis=1).repeat(DETAIL, axis=2)


def _crop(
    simulation: Simulation,
    bundle: Bundle,
    methods: dict[str, camkit.Pipeline],
    corner: tuple[int, int],
    iso: float,
) -> list[FloatArray]:
    """Return a crop as taken, by every method, and sharp; (3, CROP_PX, CROP_PX), sRGB values."""
    x, y = corner
    left, top = (max(first - MARGIN_PX, 0) for first in corner)
    around = np.s_[top : y + CROP_PX + MARGIN_PX, left : x + CROP_PX + MARGIN_PX]
    shown = np.s_[:, y - top : y - top + CROP_PX, x - left : x - left + CROP_PX]
    mosaic = np.ascontiguousarray(simulation.samples[around])
    x0, y0 = (int(v) for v in simulation.window.origin_px)
    red, green, blue = simulation.white_balance
    pictures = [_seen(mosaic, simulation, bundle, x0 + left, y0 + top)]
    for pipeline in methods.values():
        image = pipeline.process_array(
            mosaic, iso=iso, white_balance=(red, green, blue), origin_px=(x0 + left, y0 + top)
        )
        pictures.append(image)
    sharp = simulation.clean[..., y : y + CROP_PX, x : x + CROP_PX]
    matrix = rec709_of(_mosaic_sensor(bundle))
    tiles = (*(picture[shown] for picture in pictures), apply_matrix(matrix, sharp))
    return [encode_srgb(tile) for tile in tiles]


def _seen(
    mosaic: NDArray[np.uint16], simulation: Simulation, bundle: Bundle, x: int, y: int
) -> FloatArray:
    """Give a crop demosaicked, white-balanced and without vignetting: what the lens saw."""
    sensor = _mosaic_sensor(bundle)
    height, width = mosaic.shape
    window = replace(simulation.window, size_px=(width, height), origin_px=(float(x), float(y)))
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
