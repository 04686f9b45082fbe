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
from pathlib import Path

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.reader import find_bundle, open_bundle
from camkit.runtime.files.picture import read_scene
from camkit.runtime.twin.simulate import Simulation, write_capture
from camkit.scenes import procedural_scene
from tools.pictures.captions import write_captioned
from tools.pictures.crops import Place, crop_pictures, mosaic_sensor, psnr_db, take

CROP_PX = 384
DETAIL = 3
DETAIL_AT = (0.56, 0.5)
"""Top and left of what is shown `DETAIL` times as large, as shares of the photograph's crop."""
BORDER_PX = 32
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
    sensor = mosaic_sensor(bundle)
    width, height = sensor.width_px // 4 * 2, sensor.height_px // 4 * 2
    confetti = procedural_scene(arguments.seed, height, width)
    photo = read_scene(PHOTO)
    half_way = (width * 3 - photo.shape[2]) // 2, (height * 3 - photo.shape[1]) // 2
    simulations = {
        "confetti": take(confetti, bundle, (width, height), iso=arguments.iso),
        "photo": take(photo, bundle, half_way, iso=arguments.iso),
    }
    for name, simulation in simulations.items():
        write_capture(out_dir / f"{name}.dng", simulation, sensor, bundle.manifest.name)
        shape = "x".join(map(str, simulation.samples.shape[::-1]))
        print(f"{out_dir / name}.dng: {shape} at {simulation.window.origin_px}")
    print(f"simulated in {time.perf_counter() - began:.1f} s\n", flush=True)

    plan = ("plan", str(out_dir / "confetti.dng"), "--bundle", arguments.bundle)
    subprocess.run([sys.executable, "-m", "camkit", *plan], check=True)
    print(flush=True)
    for name, suffix in (("confetti", "exr"), ("photo", "png")):
        _process(out_dir / f"{name}.dng", arguments.bundle, out_dir, suffix)
    picture = out_dir / "before_after.png"
    _show_quality(simulations, arguments.bundle, arguments.iso, picture)
    print(f"all of it in {time.perf_counter() - began:.0f} s")
    print(f"Open {picture} first.")


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


def _show_quality(simulations: dict[str, Simulation], name: str, iso: float, picture: Path) -> None:
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
        simulation = simulations[scene]
        # the photograph lies half way out, and its middle is shown
        place = Place.along_diagonal(simulation.samples.shape, (CROP_PX, CROP_PX), field)
        *tiles, sharp = crop_pictures(simulation, bundle, [*methods.values()], place, iso=iso)
        decibels = [psnr_db(tile, sharp, BORDER_PX) for tile in tiles]
        print(f"{scene:<10}{field:<20.2f}" + "".join(f"{value:10.2f}" for value in decibels))
        captions = [f"{head}: {value:.2f} dB" for head, value in zip(heads, decibels, strict=True)]
        row = dict(zip((*captions, "truth"), (*tiles, sharp), strict=True))
        way = f"{100 * field:.0f} % of the way from the axis to the corner"
        rows[f"{TITLES[scene]}, {way}"] = row
        if scene == "photo":
            enlarged = zip((*heads, "truth"), map(_detail, row.values()), strict=True)
            rows[f"Part of the same, {DETAIL} times as large"] = dict(enlarged)
    write_captioned(picture, HEADING.format(bundle=bundle.manifest, iso=iso), rows)
    print(f"\n{picture}: columns {', '.join(heads)}, truth; rows as in the table")


def _detail(tile: FloatArray) -> FloatArray:
    """Return a part of a square crop, enlarged to its size; pixels stay squares."""
    side = tile.shape[1] // DETAIL
    top, left = (int(share * tile.shape[1]) for share in DETAIL_AT)
    part = tile[:, top : top + side, left : left + side]
    return part.repeat(DETAIL, axis=1).repeat(DETAIL, axis=2)


if __name__ == "__main__":
    main()
