"""A night photographed through a plate, its lights read back: a sheet of exposures and the PSF.

    python -m tools.hdr.night_gallery --out-dir out [--bundle streak-hdr]

Leaves night.dng and night.exr with its sidecar; night.png with captions, columns as developed, by
physics, with the network and the truth, rows of the frame at 0 and -4 EV and of its brightest light
at 0, -4 and -8 EV; streaks.png, the PSF of red, green and blue; and, where torch is installed, the
plate with its masks in a folder `plate`.
"""

import argparse
import math
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.sensor import BayerSensor
from camkit.colorimetry import encode_srgb
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.network.engine import available_threads
from camkit.runtime.twin.saturation import exposure_for_share
from camkit.runtime.twin.simulate import SimulationOptions, photograph, write_capture
from camkit.runtime.twin.truth import ideal_picture
from camkit.scenes import named_scene
from camkit.scenes.saturation import CEILING, with_exposure
from tools.pictures.captions import write_captioned
from tools.pictures.crops import around_brightest

SCENE: Final = "night:8"
SIDES_PX: Final = (512, 768)
SHARE: Final = 0.015
STOPS: Final = (0, -4)
STOPS_OF_DETAIL: Final = (0, -4, -8)
DETAIL: Final = 4
DECADES: Final = 6.0
HEADING: Final = (
    "{camera}: a synthetic night in one exposure, {share:.1%} of it brighter than the sensor "
    "can count\nSimulated capture. developed: streaks of the plate included; physics: lights read "
    "from their streaks; network: physics, then network {size};\n"
    "truth: the scene. PSNR of the frame in dB of linear light up to {ceiling:g} times white."
)


def main() -> None:
    """Photograph, process and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out-dir", type=Path, default=Path("out"))
    parser.add_argument("--bundle", default="streak-hdr")
    arguments = parser.parse_args()
    show_gallery(arguments.bundle, arguments.out_dir)


def show_gallery(name: str, out_dir: Path) -> None:
    """Write the gallery of a bundle, and print what was gained."""
    out_dir.mkdir(parents=True, exist_ok=True)
    bundle = open_bundle(find_bundle(name))
    dng = out_dir / "night.dng"
    pictures = night_pictures(bundle, dng)
    camkit.process(dng, bundle=name, out_dir=out_dir, overwrite=True)
    print(
        f"{dng}: {SCENE}, {SHARE:.1%} of the scene above white; "
        f"linear PSNR at {CEILING:g} times white"
    )
    columns = {}
    for title, (picture, decibels) in pictures.items():
        if title != "truth":
            print(f"  {title:<18}{decibels:6.2f} dB")
        columns[title if title == "truth" else f"{title}: {decibels:.2f} dB"] = picture
    camera = f"{bundle.manifest.name} {bundle.manifest.version}"
    heading = HEADING.format(
        camera=camera, share=SHARE, size=camkit.load(name).size, ceiling=CEILING
    )
    write_captioned(out_dir / "night.png", heading, night_rows(columns))
    write_captioned(
        out_dir / "streaks.png",
        f"{camera}: what the sensor sees of a point on the axis",
        {f"PSF by colour, logarithmic over {DECADES:g} decades": _kernels(bundle)},
    )
    print(f"{out_dir / 'night.png'}: columns {', '.join(pictures)}, truth")
    if "plate.toml" in bundle.names:
        _draw_plate(name, out_dir / "plate")


def night_pictures(bundle: Bundle, dng: Path) -> dict[str, tuple[FloatArray, float]]:
    """Photograph the night with a camera, and restore it.

    Args:
        bundle: The camera.
        dng: Where its capture is written.

    Returns:
        Way -> picture (3, h, w), linear Rec.709, and its PSNR in dB; "truth" is the last way.
    """
    sensor = bundle.manifest.sensor
    if not isinstance(sensor, BayerSensor):
        raise SystemExit(
            f"{bundle.manifest.name} has no mosaic; the gallery shows cameras with one"
        )
    scene = named_scene(SCENE, *SIDES_PX)
    saturation = exposure_for_share(scene, sensor, SHARE)
    options = SimulationOptions(seed=1, workers=available_threads(None))
    shot = photograph(with_exposure(scene, saturation.exposure), bundle, options)
    write_capture(dng, shot, sensor, bundle.manifest.name)
    truth = ideal_picture(shot, bundle)
    pipelines = {
        "developed": camkit.load(None),
        "physics": camkit.load(bundle.path, method="physics"),
        "network": camkit.load(bundle.path),
    }
    pictures = {way: pipeline.process(dng).image for way, pipeline in pipelines.items()}
    return {way: (picture, _psnr_db(picture, truth)) for way, picture in pictures.items()} | {
        "truth": (truth, math.inf)
    }


def _draw_plate(bundle: str, out_dir: Path) -> None:
    """Draw the plate of a bundle, its masks too, where the design side is installed."""
    show = ("show", bundle, "-o", str(out_dir), "--overwrite")
    masks = ("masks", bundle, "-o", str(out_dir), "--overwrite")
    if find_spec("torch") is None:
        print("To draw the plate too (needs torch):")
        print(f"  camkit plate {' '.join(show)}; camkit plate {' '.join(masks)}")
        return
    for words in (show, masks):
        subprocess.run([sys.executable, "-m", "camkit", "plate", *words], check=True)


def _psnr_db(picture: FloatArray, truth: FloatArray) -> float:
    gap = np.clip(picture, 0, CEILING) - np.clip(truth, 0, CEILING)
    return float(10 * np.log10(CEILING**2 / np.mean(np.square(gap, dtype=np.float64))))


def night_rows(columns: dict[str, FloatArray]) -> dict[str, dict[str, FloatArray]]:
    """Return the frame at `STOPS`, then its brightest light at `STOPS_OF_DETAIL`."""
    truth = columns["truth"]
    _, height, width = truth.shape
    part = around_brightest(truth, height // DETAIL, width // DETAIL)
    details = {
        name.partition(":")[0]: picture[part].repeat(DETAIL, axis=1).repeat(DETAIL, axis=2)
        for name, picture in columns.items()
    }
    frames = {f"The frame at 100 %, {stop} EV": _darker(columns, stop) for stop in STOPS}
    return frames | {
        f"Its brightest light, {DETAIL} times as large, {stop} EV": _darker(details, stop)
        for stop in STOPS_OF_DETAIL
    }


def _darker(pictures: dict[str, FloatArray], stop: int) -> dict[str, FloatArray]:
    return {n: encode_srgb(p * np.float32(2.0**stop)) for n, p in pictures.items()}


def _kernels(bundle: Bundle) -> dict[str, FloatArray]:
    """Return the kernel of every colour on the axis in grey, over `DECADES` decades."""
    sensor = bundle.manifest.sensor
    assert sensor.type == "bayer"
    kernels = color_kernels(bundle.psf, *sensor.response_arrays()).at(0.0, 0.0)
    greys = 1 + np.log10(np.maximum(kernels / kernels.max(), 10.0**-DECADES)) / DECADES
    names = (f"{colour}, {greys.shape[1]} px wide" for colour in ("red", "green", "blue"))
    return {
        name: np.broadcast_to(kernel, (3, *kernel.shape))
        for name, kernel in zip(names, greys, strict=True)
    }


if __name__ == "__main__":
    main()
