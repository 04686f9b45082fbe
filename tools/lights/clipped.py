"""What explaining clipped lights gives: PSNR and CPU seconds on procedural scenes.

    python -m tools.lights.clipped --bundles duet,duet-joint --size S

Three ways: `none` (the linear filter alone), `near` (what the runtime does) and `everywhere` (the
explanation of the whole block is kept, as camkit did before). PSNR in dB on sRGB values, 64 px of
the border left out; `lights` counts pixels up to 24 px from clipped samples alone.
"""

import argparse
import itertools
import statistics
import time
from dataclasses import replace
from typing import Any, Final

import numpy as np
import scipy.ndimage

from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.stages import Wiener
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.runtime.network.engine import available_threads
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, photograph
from camkit.scenes import procedural_scene

WAYS: Final = ("none", "near", "everywhere")
SCENE_PX: Final = (900, 1300)
BORDER_PX: Final = 64
NEAR_PX: Final = 16
SCORED_PX: Final = 24
SCENES: Final = ((7, 1.0, (2300, 1500)), (12, 0.5, (200, 200)), (13, 0.3, (3400, 2300)))
"""(seed, exposure, origin on the sensor)."""


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bundles", default="duet,duet-joint,trio-edof")
    parser.add_argument("--size", default="S")
    arguments = parser.parse_args()
    print("| bundle | seed | exposure | clipped % | way | PSNR dB | lights dB | CPU s |")
    print("|---|---|---|---|---|---|---|---|")
    found: dict[str, list[tuple[float, float, float]]] = {way: [] for way in WAYS}
    for name, (seed, exposure, origin) in itertools.product(arguments.bundles.split(","), SCENES):
        bundle = open_bundle(find_bundle(name))
        options = SimulationOptions(
            iso=100.0,
            seed=1,
            exposure=exposure,
            origin_px=origin,
            depth_mm=float(bundle.psf.depths_mm[0]),
            workers=available_threads(None),
        )
        taken = photograph(procedural_scene(seed, *SCENE_PX), bundle, options)
        clipped = taken.samples >= 0.99 * taken.samples.max()
        for way in WAYS:
            began = time.process_time()
            picture = _restored(taken, bundle, arguments.size, way)
            cpu_s = time.process_time() - began
            scores = *_scores(picture, taken, clipped), cpu_s
            found[way].append(scores)
            cells = (name, str(seed), f"{exposure:g}", f"{100 * clipped.mean():.2f}", way)
            print(f"| {' | '.join(cells)} | {' | '.join(f'{v:.2f}' for v in scores)} |", flush=True)
    for way, rows in found.items():
        means = " | ".join(f"{statistics.mean(column):.2f}" for column in zip(*rows, strict=True))
        print(f"| mean | | | | {way} | {means} |")


def _restored(taken: Simulation, bundle: Bundle, size: str, way: str) -> FloatArray:
    options = Options(size=size, undistort=False, vignetting=False, color="camera")
    pipeline = Pipeline(_explaining(bundle, way), options)
    capture = pipeline.capture_of(
        taken.samples,
        iso=taken.iso,
        white_balance=taken.white_balance,  # type: ignore[arg-type]
        origin_px=(int(taken.window.origin_px[0]), int(taken.window.origin_px[1])),
    )
    return pipeline.start(capture).fill()


def _explaining(bundle: Bundle, way: str) -> Bundle:
    """Return the bundle with another way to explain lights."""
    ways: dict[str, dict[str, Any]] = {
        "none": {"clip_iterations": 0},
        "near": {"clip_reach_px": NEAR_PX},
        "everywhere": {"clip_reach_px": None},
    }
    changes = ways[way]
    stages = tuple(
        stage.model_copy(update=changes) if isinstance(stage, Wiener) else stage
        for stage in bundle.manifest.stages
    )
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"stages": stages}))


def _scores(picture: FloatArray, taken: Simulation, clipped: np.ndarray) -> tuple[float, float]:
    error = encode_srgb(np.clip(picture, 0, 1)) - encode_srgb(np.clip(taken.clean, 0, 1))
    inner = np.s_[..., BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    squares = np.square(error[inner])
    near = scipy.ndimage.binary_dilation(clipped, iterations=SCORED_PX)[inner]
    return tuple(float(-10 * np.log10(part.mean())) for part in (squares, squares[:, near]))  # type: ignore[return-value]


if __name__ == "__main__":
    main()
