"""A night photographed through a plate, its lights read back: a sheet of exposures and the PSF.

    python -m tools.hdr.gallery --out-dir out [--bundle streak-hdr]

Leaves night.dng and night.exr with its sidecar; night.png, rows as developed, by physics, with the
network and as it was, columns at 0, -4 and -8 EV; streaks.png, the PSF of red, green and blue; and,
where torch is installed, the plate with its masks in a folder `plate`.
"""

import argparse
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import cv2
import numpy as np

import camkit
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.sensor import BayerSensor
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.network.engine import available_threads
from camkit.runtime.twin.saturation import exposure_for_share
from camkit.runtime.twin.simulate import SimulationOptions, photograph, write_capture
from camkit.runtime.twin.truth import ideal_picture
from camkit.scenes import named_scene
from camkit.scenes.saturation import CEILING, with_exposure

SCENE: Final = "night:8"
SIDES_PX: Final = (512, 768)
SHARE: Final = 0.015
STOPS: Final = (0, -4, -8)
DECADES: Final = 6.0


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
    sensor = bundle.manifest.sensor
    if not isinstance(sensor, BayerSensor):
        raise SystemExit(f"{name} has no mosaic; the gallery shows cameras with one")
    scene = named_scene(SCENE, *SIDES_PX)
    found = exposure_for_share(scene, sensor, SHARE)
    shot = photograph(
        with_exposure(scene, found.exposure),
        bundle,
        SimulationOptions(seed=1, workers=available_threads(None)),
    )
    dng = out_dir / "night.dng"
    write_capture(dng, shot, sensor, bundle.manifest.name)
    camkit.process(dng, bundle=name, out_dir=out_dir, overwrite=True)
    pictures = {
        "as developed": camkit.load(None).process(dng).image,
        "by physics": camkit.load(name, method="physics").process(dng).image,
        "with the network": camkit.load(name).process(dng).image,
        "as it was": ideal_picture(shot, bundle),
    }
    truth = pictures["as it was"]
    print(f"{dng}: {SCENE}, {SHARE:.1%} of the scene above white; linear PSNR at 2^8 times white")
    for title, picture in pictures.items():
        if picture is not truth:
            print(f"  {title:<18}{_psnr_db(picture, truth):6.2f} dB")
    _write(out_dir / "night.png", _sheet(list(pictures.values())))
    _write(out_dir / "streaks.png", _psf_sheet(bundle))
    print(f"{out_dir / 'night.png'}: rows {', '.join(pictures)}; columns {STOPS} EV")
    if "plate.toml" in bundle.names:
        _draw_plate(name, out_dir / "plate")


def _draw_plate(bundle: str, out_dir: Path) -> None:
    """Draw the plate of a bundle, its masks too, where the design side is installed."""
    show = ("show", bundle, "-o", str(out_dir), "--overwrite")
    masks = ("masks", bundle, "-o", str(out_dir), "--overwrite")
    if find_spec("torch") is None:
        print(f"with torch: camkit plate {' '.join(show)}; camkit plate {' '.join(masks)}")
        return
    for words in (show, masks):
        subprocess.run([sys.executable, "-m", "camkit", "plate", *words], check=True)


def _psnr_db(picture: FloatArray, truth: FloatArray) -> float:
    gap = np.clip(picture, 0, CEILING) - np.clip(truth, 0, CEILING)
    return float(10 * np.log10(CEILING**2 / np.mean(np.square(gap, dtype=np.float64))))


def _sheet(pictures: list[FloatArray]) -> FloatArray:
    rows = [
        np.concatenate([encode_srgb(p * np.float32(2.0**stop)) for stop in STOPS], axis=2)
        for p in pictures
    ]
    return np.concatenate(rows, axis=1)


def _psf_sheet(bundle: Bundle) -> FloatArray:
    """Give the kernels of the colours side by side, over `DECADES` decades."""
    sensor = bundle.manifest.sensor
    assert sensor.type == "bayer"
    kernels = color_kernels(bundle.psf, *sensor.response_arrays()).at(0.0, 0.0)
    shown = 1 + np.log10(np.maximum(kernels / kernels.max(), 10.0**-DECADES)) / DECADES
    tiles = np.zeros((3, kernels.shape[1], 3 * kernels.shape[2]), np.float32)
    for colour in range(3):
        left = colour * kernels.shape[2]
        tiles[colour, :, left : left + kernels.shape[2]] = shown[colour]
    return tiles


def _write(path: Path, picture: FloatArray) -> None:
    pixels = (np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)
    if not cv2.imwrite(str(path), pixels.transpose(1, 2, 0)[..., ::-1]):
        raise OSError(f"cannot write {path}")


if __name__ == "__main__":
    main()
