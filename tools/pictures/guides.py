"""Pictures of guides and start pages: `make pictures`.

    python -m tools.pictures.guides -o docs/images [PICTURE ...]

photons-depth.png   depth and sigma of the box of docs/start/photons.md
laws.jpg            lamps behind a network with and without its bound; reads an older bundle by git
moving-lamps.jpg    lamps that move: a bracket beside one exposure through a plate
portable-chain.png  the graphs of `camkit portable`
"""

import subprocess
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Final

import numpy as np

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.manifest import LIGHT_VERSION
from camkit.bundle.reader import find_bundle, open_bundle
from camkit.colorimetry import encode_srgb
from camkit.report.figure import Figure, chart, new_figure, to_png
from camkit.report.kinds.hdr.lights import dimmed, with_lamp
from camkit.runtime.files.picture import read_light
from camkit.runtime.kinds.spad.twin.photon_twin import record
from camkit.runtime.kinds.spad.twin.recording import PhotonOptions
from camkit.runtime.kinds.spad.twin.write import write_recorded
from camkit.runtime.merging.result import merge_to_exr
from camkit.runtime.merging.survey import survey
from camkit.runtime.network.engine import available_threads
from camkit.runtime.proof.laws.darkroom import Darkroom
from camkit.runtime.proof.laws.photographs import DARK
from camkit.runtime.twin.exposure import Setting
from camkit.runtime.twin.simulate import SimulationOptions, photograph, write_capture
from camkit.runtime.twin.truth import ideal_picture
from camkit.scenes import named_scene
from camkit.scenes.charts import LAMP_PITCH_PX, lamp_chart
from tools.pictures.arguments import read_arguments
from tools.pictures.captions import write_captioned
from tools.pictures.crops import mosaic_sensor
from tools.pictures.portable_chain import portable_chain

BOX_M, WALL_M = 0.20, 0.26
DEPTH_PHOTONS: Final = PhotonOptions(photons=300, sbr=3)
"""As docs/start/photons.md scans it."""
OLD_BUNDLE: Final = "784786e:camkit/bundles/duet.camkit"
"""`duet` 0.3, the last one whose network was trained without a bound."""
LAMPS: Final = np.s_[:, 2 * LAMP_PITCH_PX :, LAMP_PITCH_PX : 3 * LAMP_PITCH_PX]
"""Lamps of 12 and 24 px, 8 and 40 times white."""
NIGHT: Final = "night:3"
NIGHT_PX: Final = 384
NIGHT_CROP: Final = np.s_[:, 80:304, 80:304]
TIMES: Final = (1.0, 2.0**-4, 2.0**-8)
MOVING: Final = (
    ((170.0, 150.0), (0.0, 10.0), 8.0, 100.0),
    ((235.0, 225.0), (-6.0, -8.0), 5.0, 40.0),
)
"""Of each lamp: (y, x) in the first frame, its way to the next one, radius in pixels, power."""
STOPS: Final = (0, -5)
HEADING: Final = (
    "Two lamps that move by 10 px between frames of 0, -4 and -8 EV. Simulated, at 100 %."
)


def main() -> None:
    """Write the pictures."""
    out_dir, pictures = read_arguments(__doc__.splitlines()[0], PICTURES, "PICTURE")
    for name in pictures:
        path = out_dir / name
        with TemporaryDirectory() as folder:
            PICTURES[name](path, Path(folder))
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB", flush=True)


def write_depth(path: Path, folder: Path) -> None:
    """Draw depth and sigma of a box before a wall, as `spad-sr` scans them."""
    y, x = np.mgrid[0:128, 0:256]
    box = (abs(x - 128) < 50) & (abs(y - 64) < 30)
    scene, scan = folder / "scene.npz", folder / "scan.npz"
    np.savez(scene, depth_m=np.where(box, BOX_M, WALL_M), albedo=np.full(box.shape, 0.8))
    write_recorded(scan, record(scene, open_bundle(find_bundle("spad-sr")), DEPTH_PHOTONS))
    camkit.process(scan, bundle="spad-sr", out_dir=folder / "out", product="depth")
    with np.load(folder / "out" / "scan.npz") as products:
        figure = depth_chart(products["depth_m"], products["sigma_ps"])
    path.write_bytes(to_png(figure))


@chart
def depth_chart(depth_m: FloatArray, sigma_ps: FloatArray) -> Figure:
    """Return maps (h, w) side by side: near red, far blue; sigma from 0 to its 99th percentile."""
    figure = new_figure(6.9, 2.1)
    left, right = figure.subplots(1, 2)
    high = float(np.nanquantile(sigma_ps, 0.99))
    for panel, values, (low, most), colours, label in (
        (left, depth_m, (BOX_M - 0.02, WALL_M + 0.02), "turbo_r", "depth_m in m"),
        (right, sigma_ps, (0.0, high), "viridis", "sigma_ps in ps"),
    ):
        mapping = panel.imshow(values, cmap=colours, vmin=low, vmax=most)
        panel.set_xlabel("x in sub-pixels")
        panel.set_ylabel("y in sub-pixels")
        figure.colorbar(mapping, ax=panel, label=label, shrink=0.75)
    return figure


def write_law(path: Path, folder: Path) -> None:
    """Photograph lamps with an older bundle, restored with and without a bound.

    Raises:
        SystemExit: If the history does not hold it.
    """
    old = folder / "duet.camkit"
    with old.open("wb") as out:
        process = subprocess.run(["git", "show", OLD_BUNDLE], stdout=out, check=False)
    if process.returncode:
        raise SystemExit(f"cannot read {OLD_BUNDLE}: run it in a clone with the whole history")
    write_lamps(path, old)


def write_lamps(path: Path, old: Path) -> None:
    """Draw lamps behind the network of a bundle whose format states no bound.

    Args:
        path: PNG or JPEG.
        old: The bundle, of a format before 2.8; its largest network is taken.
    """
    free = open_bundle(old)
    version = ".".join(map(str, LIGHT_VERSION))
    bound = replace(free, manifest=free.manifest.model_copy(update={"format_version": version}))
    chart, size = lamp_chart(), free.manifest.sizes[-1]
    columns = {}
    for name, bundle in {"no bound": free, "bound": bound}.items():
        room = Darkroom(bundle=bundle, size=size, threads=available_threads(None))
        (shot,) = room.expose(chart.scene, "middle", [Setting(iso=room.isos[0])])
        truth, picture = shot.truth[LAMPS], shot.network[LAMPS]
        dark = np.mean(picture.min(axis=0)[truth.min(axis=0) >= 1] < DARK["white_below_half"][0])
        columns[f"{name}: {dark:.0%} too dark"] = encode_srgb(picture)
    columns["truth"] = encode_srgb(truth)
    camera = f"{free.manifest.name} {free.manifest.version}"
    heading = (
        f"White lamps of 12 and 24 px, 8 and 40 times white, behind network {size} of {camera}"
    )
    write_captioned(path, heading, {"Too dark: a colour below half of white": columns})


def write_moving_lamps(path: Path, folder: Path) -> None:
    """Photograph lamps that move as a bracket of the bare lens, and once through its plate."""
    bundle = open_bundle(find_bundle("streak-hdr"))
    sensor, name = mosaic_sensor(bundle), bundle.manifest.name
    dark = dimmed(named_scene(NIGHT, NIGHT_PX, NIGHT_PX))
    scenes = [_with_lamps(dark, number) for number in range(len(TIMES))]
    frames = [folder / f"{number}.dng" for number in range(len(TIMES))]
    for number, (frame, scene, time) in enumerate(zip(frames, scenes, TIMES, strict=True)):
        options = _options(number, exposure=time, plate=False)
        write_capture(frame, photograph(scene, bundle, options), sensor, name)
    merge_to_exr(survey(frames, TIMES), folder / "merged.exr", reference=frames[0].name)
    once = photograph(scenes[0], bundle, _options(len(TIMES)))
    write_capture(folder / "once.dng", once, sensor, name)
    pictures = {
        "bracket, merged": read_light(folder / "merged.exr"),
        "one exposure, restored": camkit.load(name).process(folder / "once.dng").image,
        "truth": ideal_picture(once, bundle),
    }
    rows = {
        f"{-stop} stops darker" if stop else "As exposed": {
            caption: encode_srgb(picture[NIGHT_CROP] * np.float32(2.0**stop))
            for caption, picture in pictures.items()
        }
        for stop in STOPS
    }
    write_captioned(path, HEADING, rows)


def _with_lamps(dark: FloatArray, number: int) -> FloatArray:
    """Return a scene with its lamps at the moment of a frame."""
    scene = dark
    for (y, x), (down, right), radius_px, power in MOVING:
        scene = with_lamp(scene, (y + number * down, x + number * right), radius_px, power)
    return scene


def _options(seed: int, *, exposure: float = 1.0, plate: bool = True) -> SimulationOptions:
    threads = available_threads(None)
    return SimulationOptions(seed=seed, exposure=exposure, plate=plate, workers=threads)


def write_chain(path: Path, _folder: Path) -> None:
    """Draw the graphs of `camkit portable`."""
    path.write_bytes(to_png(portable_chain()))


PICTURES: Final[Mapping[str, Callable[[Path, Path], None]]] = MappingProxyType(
    {
        "photons-depth.png": write_depth,
        "moving-lamps.jpg": write_moving_lamps,
        "portable-chain.png": write_chain,
        "laws.jpg": write_law,  # last: it needs the whole history
    }
)


if __name__ == "__main__":
    main()
