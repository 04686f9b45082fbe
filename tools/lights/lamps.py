"""Share of lamps that come out dark in whole scenes, and PSNR, behind networks and their front end.

    python -m tools.lights.lamps duet OLD.camkit --scenes night:0 night:1 night:2

Scenes of 768x512 pixels in the middle of the sensor at the lowest ISO, exposed so that 0.5 % of
the pixels saturate. Of what is white in the truth: the shares below 0.5 and below 0.2 in the
darkest colour; PSNR in dB on sRGB values.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.report.quality import psnr
from camkit.runtime.network.engine import available_threads
from camkit.runtime.proof.laws.darkroom import Darkroom
from camkit.runtime.twin.saturation import exposure_for_share
from camkit.runtime.twin.truth import light_sensor
from camkit.scenes.saturation import with_exposure
from camkit.scenes.scene_register import named_scene

SIZE_PX: Final = (512, 768)
SATURATED: Final = 0.005
DARK: Final = (0.5, 0.2)
Row = tuple[str, tuple[float, ...]]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bundles", nargs="+")
    parser.add_argument("--scenes", nargs="+", default=[f"night:{seed}" for seed in range(8)])
    arguments = parser.parse_args()
    print("| bundle | picture | below 0.5 % | below 0.2 % | PSNR dB |\n|---|---|---|---|---|")
    for name in arguments.bundles:
        bundle = open_bundle(find_bundle(Path(name)))
        whose = f"{bundle.manifest.name} {bundle.manifest.version}"
        for size in bundle.manifest.sizes:
            for picture, numbers in rows_of(bundle, size, arguments.scenes):
                cells = " | ".join(f"{number:.2f}" for number in numbers)
                print(f"| {whose} | {picture} | {cells} |", flush=True)


def rows_of(bundle: Bundle, size: str, scenes: list[str]) -> Iterator[Row]:
    """Yield the numbers of the networks and of their front end: each scene, then their mean."""
    room = Darkroom(bundle=bundle, size=size, threads=available_threads(None))
    found: dict[str, list[tuple[float, ...]]] = {size: [], f"front end of {size}": []}
    for scene in scenes:
        light = named_scene(scene, *SIZE_PX)
        exposure = exposure_for_share(light, light_sensor(bundle.manifest), SATURATED).exposure
        seen = room.expose(with_exposure(light, exposure), "middle", iso=room.isos[0])
        for whose, picture in zip(found, (seen.network, seen.front), strict=True):
            found[whose].append(numbers_of(picture, seen.truth))
            yield f"{whose}, {scene}", found[whose][-1]
    for whose, numbers in found.items():
        yield f"{whose}, mean", tuple(float(mean) for mean in np.mean(numbers, axis=0))


def numbers_of(picture: FloatArray, truth: FloatArray) -> tuple[float, float, float]:
    """Return the shares in % of white pixels that are dark, and the PSNR in dB."""
    white = truth.min(axis=0) >= 1
    darkest = picture.min(axis=0)[white]
    half, fifth = (100 * float(np.mean(darkest < below)) if white.any() else 0.0 for below in DARK)
    shown = (encode_srgb(np.clip(p, 0, 1)).astype(np.float64) for p in (truth, picture))
    return half, fifth, psnr(*shown)


if __name__ == "__main__":
    main()
