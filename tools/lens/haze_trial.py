"""What undoing the haze gains: a thin plate's capture of a whole frame, and what is made of it.

    camkit freeze thin-plate -o psf.safetensors --haze haze.safetensors
    python -m tools.lens.haze_trial psf.safetensors haze.safetensors PICTURE

The camera is that of a recipe, `thin_plate` unless said, and has no network. The picture is
repeated, every second one mirrored, until it fills the frame, so that its detail is as fine as it
comes. Printed are dB of sRGB against the sharp frame, over all and by zones of the half diagonal,
and seconds of the processor; `-o` keeps the bundle, `--keep` the capture.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.haze_file import read_haze
from camkit.bundle.psf_file import read_psf
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Dehaze
from camkit.colorimetry import encode_srgb
from camkit.models_def.kinds.bayer.frames.photographs import physics_bundle
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.training.kind import read_recipe
from camkit.report.analysis.recovery import filled, restored
from camkit.report.quality import read_picture
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, photograph, write_capture
from camkit.runtime.twin.truth import light_sensor, true_picture
from tools.hdr.record import in_one_line
from tools.lens.whole_frames import RIM_PX, SIMPLE, measures, options

RECIPE: Final = Path(__file__).parents[2] / "models_def" / "recipes" / "thin_plate.toml"


@in_one_line
def main() -> None:
    """Build, photograph, restore, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("psf", type=Path)
    parser.add_argument("haze", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--recipe", type=Path, default=RECIPE, help="of the camera")
    parser.add_argument("--iso", type=float, default=100.0)
    parser.add_argument("--size", type=int, nargs=2, metavar=("W", "H"), help="of the frame")
    parser.add_argument("-o", "--output", type=Path, help="keep the bundle")
    parser.add_argument("--keep", type=Path, help="keep the capture (DNG)")
    for name, default in (("terms", 32), ("rounds", 3)):
        parser.add_argument(f"--{name}", type=int, default=default)
    chosen = parser.parse_args()
    with TemporaryDirectory() as folder:
        out = chosen.output or Path(folder) / "trial.camkit"
        optics = FrozenOptics(psf=read_psf(chosen.psf), haze=read_haze(chosen.haze))
        recipe = read_recipe(chosen.recipe)
        if not isinstance(recipe, BayerRecipe):
            parser.error(f"{chosen.recipe} is of another kind of camera")
        bundle = build(recipe, optics, out, terms=chosen.terms, rounds=chosen.rounds)
        whole = bundle.manifest.sensor.known_extent
        size = tuple(chosen.size or (whole.width_px, whole.height_px))
        made, seconds = timed(
            lambda: photograph(
                filled(read_picture(chosen.picture), *size),
                bundle,
                SimulationOptions(iso=chosen.iso, distort=False, vignette=False),
            )
        )
        print(f"photographed in {seconds:.1f} s of the processor")
        if chosen.keep:
            write_capture(chosen.keep, made, bundle.manifest.sensor, recipe.name)
        print("| method | dB | by zones of the half diagonal | s |")
        print("|---|---|---|---|")
        for method in SIMPLE:
            print(measured(bundle, made, method), flush=True)


def build(
    recipe: BayerRecipe, optics: FrozenOptics, out: Path, *, terms: int, rounds: int
) -> Bundle:
    """Write the camera of a recipe without its networks, before optics with a haze."""
    assert optics.haze is not None
    stage = Dehaze(shrink=optics.haze.cell_px, terms=terms, rounds=rounds)
    return physics_bundle(replace(recipe, haze=stage), optics, out)


def measured(bundle: Bundle, made: Simulation, method: str) -> str:
    """Restore a capture by a method; give the line of a table."""
    pipeline = Pipeline(bundle, options(method=method))
    picture, seconds = timed(lambda: restored(pipeline, made))
    apart = encode_srgb(picture)
    apart -= encode_srgb(true_picture(made.clean, light_sensor(bundle.manifest)))
    found = measures(apart, RIM_PX)
    line = " ".join(f"{zone:.1f}" for zone in found["zones"])
    return f"| {method} | {found['db']:.2f} | {line} | {seconds:.1f} |"


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Do some work; give what it made and its seconds of the processor."""
    start = time.process_time()
    made = work()
    return made, time.process_time() - start


if __name__ == "__main__":
    main()
