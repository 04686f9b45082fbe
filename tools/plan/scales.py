"""Accuracy and CPU seconds of smaller scales and of drafts, beside the exact picture.

    python -m tools.plan.scales --bundle duet --data DATA/photos_hires DATA/valid_open

Every picture is photographed by the digital twin at an ISO of its turn. PSNR is that of sRGB values
in sensor geometry: against the sharp picture for whole pictures, against its averages over squares
for smaller ones, and there the exact picture is averaged over the same squares.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.colorimetry import apply_matrix, encode_srgb
from camkit.report.quality import BORDER_PX, list_set, read_picture
from camkit.runtime.geometry.shrink import shrunk
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.binned_work import SIDES_PX
from tools.capture.simulated import color_sensor, rec709_of
from tools.plan.cells import photograph, start
from tools.tables.records import markdown_table

ISOS: Final = (100.0, 400.0, 1600.0)
EXACT: Final = "exact M"
CHOICES: Final[Mapping[str, Options]] = {
    EXACT: Options(size="M", undistort=False, threads=1),
    "exact S": Options(size="S", undistort=False, threads=1),
    "draft": Options(quality="draft", undistort=False, threads=1),
    "scale 1/2": Options(scale="1/2", undistort=False, threads=1),
    "scale 1/4": Options(scale="1/4", undistort=False, threads=1),
}


def main() -> int:
    """Print a table of all choices over the pictures of some folders."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", default="duet", help="name or path")
    parser.add_argument("--data", type=Path, nargs="+", required=True, help="folders of pictures")
    parser.add_argument("--most-px", type=int, default=2048, help="longer side of the pictures")
    options = parser.parse_args()
    paths = [path for folder in options.data for path in list_set(folder)]
    rows = list(measure(open_bundle(find_bundle(options.bundle)), paths, options.most_px))
    heads = ["choice", "PSNR", "exact M averaged alike", "CPU over exact M"]
    cells = [
        [
            name,
            f"{np.mean([row[name][0] for row in rows]):.2f} dB",
            f"{np.mean([row[name][1] for row in rows]):.2f} dB",
            f"{np.median([row[name][2] / row[EXACT][2] for row in rows]):.3f}",
        ]
        for name in CHOICES
    ]
    print(markdown_table(heads, cells))
    return 0


def measure(
    bundle: Bundle, paths: list[Path], most_px: int
) -> Iterator[dict[str, tuple[float, float, float]]]:
    """Yield for every picture: choice -> (its PSNR, that of the exact one alike, CPU seconds)."""
    pipelines = {name: Pipeline(bundle, options) for name, options in CHOICES.items()}
    coarsest = max(SIDES_PX.values())
    for number, path in enumerate(paths):
        scene = read_picture(path, most_px)
        height, width = (side // coarsest * coarsest for side in scene.shape[1:])
        scene = np.ascontiguousarray(scene[:, :height, :width])
        simulation = photograph(bundle, scene, number=number, iso=ISOS[number % len(ISOS)])
        sharp = apply_matrix(rec709_of(color_sensor(bundle)), simulation.clean)
        pictures, seconds = {}, {}
        for name, pipeline in pipelines.items():
            began = time.process_time()
            pictures[name] = start(pipeline, simulation).fill(None)
            seconds[name] = time.process_time() - began
        yield {
            name: (
                psnr_db(picture, sharp),
                psnr_db(shrunk(pictures[EXACT], sharp.shape[1] // picture.shape[1]), sharp),
                seconds[name],
            )
            for name, picture in pictures.items()
        }


def psnr_db(picture: FloatArray, sharp: FloatArray) -> float:
    """Return the PSNR of a linear picture against the sharp one, averaged to its size."""
    side = sharp.shape[1] // picture.shape[1]
    border = BORDER_PX // side
    inside = np.s_[:, border:-border, border:-border]
    errors = encode_srgb(picture)[inside] - encode_srgb(shrunk(sharp, side))[inside]
    return float(-10 * np.log10(np.mean(np.square(errors, dtype=np.float64))))


if __name__ == "__main__":
    sys.exit(main())
