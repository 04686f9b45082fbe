"""Depth on the fine grid of a bundle against maps that are fitted first and enlarged afterwards.

    python -m tools.spad.depth --bundle spad-sr -o docs/results/spad/depth-fine.json

Surfaces before a leaning wall (`stage_set`), as bright as procedural scenes are, recorded by the
array at some levels of light. Rows: `enlarged` (every pixel of the array fitted, the map enlarged
linearly at the true phase), `linear`, every size of network, and `auto`, what `camkit process`
takes. Of every way the mean error, the share of sub-pixels further off than 15 mm, the 68 %
quantile of |error| / sigma over those believed, and how many are believed. Scenes of other seeds
than those that constants were chosen on.
"""

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.contracts import FloatArray
from camkit.report.bench.machine import describe_machine
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.depth import FineSharpener
from camkit.runtime.kinds.spad.golden_captures import stage_set
from camkit.runtime.kinds.spad.sharpen import Sharpened, Sharpener, Way
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.kinds.spad.twin.counting import Disturbances, count_times, scaled_to
from camkit.runtime.kinds.spad.twin.scene import light_of_depth
from camkit.runtime.kinds.spad.twin.simulate import seen_by, times_of
from camkit.scenes import procedural_scene
from tools.comparison.compact_json import to_compact_json

LIGHTS: Final = ((30.0, 3.0), (100.0, 3.0), (300.0, 3.0), (1000.0, 3.0), (10_000.0, 10.0))
"""Signal photons of a pixel, on average, and their ratio to those of the background."""
FIRST_SEED: Final = 400
FAR_MM: Final = 15.0
MM: Final = 1000.0
DIGITS: Final = 5
DARKEST: Final = 0.15
"""Albedo of black."""


def main(words: Sequence[str] | None = None) -> None:
    """Measure and write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", default="spad-sr", help="NAME or PATH")
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words)
    camera = FineCamera.of(open_bundle(find_bundle(arguments.bundle)))
    rows = []
    for photons, sbr in LIGHTS:
        for row in measure(camera, photons, sbr, arguments.scenes):
            rows.append(row)
            print(json.dumps(row), flush=True)
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    record = {"machine": describe_machine(), "scenes": arguments.scenes, "rows": rows}
    arguments.output.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")


def measure(
    camera: FineCamera, photons: float, sbr: float, scenes: int
) -> Iterator[dict[str, Any]]:
    """Return a row for every way, at one level of light."""
    ways = _ways(camera)
    found: dict[str, list[tuple[float, ...]]] = {name: [] for name in ways}
    ratios: dict[str, list[NDArray[np.float64]]] = {name: [] for name in ways}
    for seed in range(FIRST_SEED, FIRST_SEED + scenes):
        depth, counts = record(camera, seed, photons, sbr)
        for name, way in ways.items():
            began = time.process_time()
            made = way(counts)
            seconds = time.process_time() - began
            error = np.abs(made.time_of_flight_ps[0] * LIGHT_M_PER_PS / 2 - depth) * MM
            valid = made.valid[0]
            sigma = made.sigma_ps[0] * LIGHT_M_PER_PS / 2 * MM
            ratios[name].append((error / sigma)[valid])
            far = float((error > FAR_MM).mean())
            found[name].append((float(error.mean()), far, float(valid.mean()), seconds))
    for name, several in found.items():
        error, far, valid_share, _ = np.mean(several, axis=0)
        yield {
            "method": name,
            "photons": photons,
            "sbr": sbr,
            "mean_error_mm": float(error),
            "far_share": float(far),
            "over_enlarged": float(error / np.mean([one[0] for one in found["enlarged"]])),
            "sigma_68": None
            if name == "enlarged"
            else float(np.quantile(np.concatenate(ratios[name]), 0.6827)),
            "valid_share": float(valid_share),
            "cpu_seconds": float(np.median([one[3] for one in several])),
        }


def record(
    camera: FineCamera, seed: int, photons: float, sbr: float
) -> tuple[NDArray[np.float64], FloatArray]:
    """Return depth in metres on the fine grid, and counts (h, w, bins) of it."""
    axis, pulse = times_of(camera)
    depth = stage_set(camera, seed)
    coded = np.clip(procedural_scene(seed, *depth.shape).mean(axis=0), 0, 1) ** (1 / 2.2)
    light = light_of_depth(depth, DARKEST + (1 - DARKEST) * coded, axis, pulse)
    mean = scaled_to(seen_by(camera, light), photons) + photons / sbr / axis.bins
    counts = count_times(mean, axis.orientation, Disturbances(), np.random.default_rng(seed))
    return depth, np.ascontiguousarray(counts.transpose(1, 2, 0), dtype=np.float32)


def _ways(camera: FineCamera) -> dict[str, Any]:
    axis, pulse = times_of(camera)
    shape = (camera.sensor.height_px, camera.sensor.width_px)
    nothing, dark = np.zeros(shape, dtype=bool), np.zeros(shape)
    alone = Sharpener(axis, pulse, Way(pool="1"))

    def fine(size: str | None, *, always: bool = True) -> Any:
        sharpener = FineSharpener(camera, axis, pulse, Way(), size=size, always=always)
        return lambda counts: sharpener.cube(counts, dark, hot=nothing, blind=nothing).found

    ways: dict[str, Any] = {
        "enlarged": lambda counts: _enlarged(alone.strip(counts), camera),
        "linear": fine(None),
    }
    ways |= {size: fine(size) for size in camera.sizes}
    return ways | {"auto": fine(camera.size_of_bins(None), always=False)}


def _enlarged(found: Sharpened, camera: FineCamera) -> Any:
    """Return a map of the array's pixels on the fine grid, by linear interpolation."""
    scale, phase = camera.scale, camera.sensor.phase
    places = np.array([[scale, 0, phase], [0, scale, phase]], np.float64)
    size = (scale * camera.sensor.width_px, scale * camera.sensor.height_px)

    def larger(values: NDArray[np.floating]) -> NDArray[np.float64]:
        border = cv2.BORDER_REPLICATE
        made = cv2.warpAffine(values.astype(np.float64), places, size, borderMode=border)
        return np.asarray(made, np.float64)[None]

    return replace(
        found,
        time_of_flight_ps=larger(found.time_of_flight_ps[0]),
        sigma_ps=larger(found.sigma_ps[0]),
        valid=larger(found.valid[0].astype(np.float64)) > 0.5,
    )


if __name__ == "__main__":
    main()
