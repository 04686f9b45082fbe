"""Measure portable cameras: `python -m tools.portable_table BUNDLE.camkit... -o FILE.json`.

Each bundle is written as graphs (`camkit portable`) and run by `examples/python` on its golden
captures, beside camkit: decibels (peak 1.0) behind the bank, before undistortion and at the end,
and the largest difference from the stored result beside what its case allows, and beside the
brightest value of the case, which tells more of dark ones. With `--depth-m` graphs take the kernels
of that distance, and the result is that of camkit told so. Of an array of single photons its
pictures are compared, relative to the brightest value. Times are CPU
seconds of one thread: of each graph the median of some calls, and of a whole capture both
interleaved, with `--repeat N` tiles of a simulated capture of 1500x1000 along each side.
"""

import argparse
import importlib.util
import json
import math
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.golden import IMAGE, golden_from_bytes
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import GOLDEN, Bundle, open_bundle
from camkit.runtime.kind import part_of
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.portable.package import write_portable
from camkit.runtime.twin.simulate import SimulationOptions
from camkit.scenes import procedural_scene
from camkit.units import MM_PER_M

READERS: Final = Path(__file__).parents[1] / "examples" / "python"
SCENE_SEED: Final = 7
ISO: Final = 400.0
EXPOSURE: Final = 0.25
SIDES_PX: Final = (1000, 1500)
CALLS: Final = 9
NEAR_CLIPPING: Final = 0.8
"""Of white: brighter samples are raised behind the bank, and not compared there."""

Facts = tuple[NDArray[Any], float, Any, Any]
"""A capture, its ISO, white balance and place."""


def measured(path: Path, repeat: int, depth_m: float | None = None) -> dict[str, Any]:
    """Return the numbers of one bundle, all its sizes.

    Args:
        path: The bundle.
        repeat: Tiles of the simulated capture along each side; 0 leaves the times out.
        depth_m: Object distance whose kernels the graphs take; None for what the bundle does.
    """
    bundle = open_bundle(path)
    depth_mm = None if depth_m is None else depth_m * MM_PER_M
    with tempfile.TemporaryDirectory() as folder:
        files = write_portable(bundle, Path(folder) / "out", depth_mm=depth_mm)
        if bundle.manifest.kind == "spad":
            return _array(bundle, Path(folder) / "out", files)
        reader = load_example("portable_camera")
        cameras = {
            size: reader.PortableCamera(Path(folder) / "out", size)
            for size in bundle.manifest.sizes
        }
        facts = cameras["S"].facts
        return {
            "name": bundle.manifest.name,
            "version": bundle.manifest.version,
            "agrees": facts["agrees"],
            "megabytes": {name: round(count / 1e6, 3) for name, count in files.items()},
            "golden": [
                row
                for size, camera in cameras.items()
                for row in _golden(bundle, camera, {"size": size, "depth_m": depth_m})
            ],
            "graph_ms": _graph_times(bundle, cameras) if repeat else {},
            "frames": [
                _frame(bundle, camera, {"size": size, "depth_m": depth_m}, repeat)
                for size, camera in cameras.items()
                if repeat
            ],
        }


def _array(bundle: Bundle, folder: Path, files: Mapping[str, int]) -> dict[str, Any]:
    """Return the numbers of an array of single photons: its golden pictures."""
    rows, golden = [], golden_from_bytes(bundle.member(GOLDEN))
    reader = load_example("portable_frames")
    for size in bundle.manifest.sizes:
        array = reader.PortableArray(folder, size)
        for case in bundle.manifest.golden:
            stored = golden[case.name].output(IMAGE, size)
            if stored is not None:
                capture = np.ascontiguousarray(golden[case.name].capture)
                facts = capture, case.iso, case.white_balance, case.origin_px
                ours = _camkit(bundle, facts, size=size)
                rows.append(_difference(case, size, array.develop(capture[None]), (stored, ours)))
    return {
        "name": bundle.manifest.name,
        "version": bundle.manifest.version,
        "megabytes": {name: round(count / 1e6, 3) for name, count in files.items()},
        "golden": rows,
    }


def _difference(
    case: GoldenCase,
    size: str,
    picture: NDArray[np.float32],
    stored_and_ours: tuple[NDArray[np.float32], NDArray[np.float32]],
) -> dict[str, Any]:
    """Return what a case allows, and how far a picture lies from the stored one, and from camkit's.

    The stored one is in half precision.
    """
    stored, ours = stored_and_ours
    brightest = float(np.abs(stored).max())
    allowed = case.atol + case.rtol * max(1.0, brightest)
    difference = float(np.abs(picture - stored).max())
    return {
        "case": case.name,
        "size": size,
        "difference": difference,
        "allowed": allowed,
        "is_met": difference <= allowed,
        "brightest": brightest,
        "end_db_of_brightest": _decibels(picture / brightest, ours / brightest),
    }


def load_example(name: str) -> Any:
    """Return a reader of `examples/python`, which is no package, as a module."""
    spec = importlib.util.spec_from_file_location(name, READERS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _camkit(bundle: Bundle, facts: Facts, **options: Any) -> NDArray[np.float32]:
    pipeline = Pipeline(bundle, Options(threads=1, **options))
    capture, iso, white_balance, origin_px = facts
    work = pipeline.start(
        pipeline.capture_of(capture, iso=iso, white_balance=white_balance, origin_px=origin_px)
    )
    return np.asarray(work.fill(product=IMAGE))


def _decibels(a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    error = float(np.mean(np.square(a - b, dtype=np.float64)))
    return round(-10 * math.log10(max(error, 1e-30)), 1)


def _golden(bundle: Bundle, camera: Any, options: dict[str, Any]) -> list[dict[str, Any]]:
    """Return one row for every golden case."""
    size = options["size"]
    rows, golden = [], golden_from_bytes(bundle.member(GOLDEN))
    for case in bundle.manifest.golden:
        arrays = golden[case.name]
        facts = np.ascontiguousarray(arrays.capture), case.iso, case.white_balance, case.origin_px
        plain = {"undistort": False, "color": "camera"}
        even = camera.develop(*facts, straight=False)
        picture = camera.develop(*facts)
        ours = _camkit(bundle, facts, **options)
        stored = arrays.output(IMAGE, size) if options["depth_m"] is None else ours
        assert stored is not None
        sensor = camera.sensor
        black, white = sensor["black_level"], sensor["white_level"]
        clip = black + sensor["clip_share"] * (white - black)
        axis = np.subtract(sensor["axis_px"], case.origin_px)
        bank = camera.restore(facts[0], facts[0] >= clip, axis)[3:]
        expected = _camkit(bundle, facts, method="wiener", vignetting=False, **options, **plain)
        dark = (expected < NEAR_CLIPPING).all(axis=0)
        decibels = {
            "bank_db": _decibels(bank[:, dark], expected[:, dark]),
            "before_undistortion_db": _decibels(even, _camkit(bundle, facts, **options, **plain)),
            "end_db": _decibels(picture, ours),
        }
        rows.append(decibels | _difference(case, size, picture, (stored, ours)))
    return rows


def _capture(bundle: Bundle, repeat: int) -> Facts:
    """Return a simulated capture, off the axis if it is not repeated."""
    height, width = SIDES_PX
    options = SimulationOptions(
        iso=ISO, seed=SCENE_SEED, origin_px=(4300, 2800), exposure=EXPOSURE, scale=1
    )
    scene = procedural_scene(SCENE_SEED, height, width)
    simulation = part_of(bundle.manifest).simulate(scene, bundle, options)
    whole = np.ascontiguousarray(np.tile(simulation.samples, (repeat, repeat)))
    origin = (4300, 2800) if repeat == 1 else (0, 0)
    return whole, ISO, simulation.white_balance, origin


def _graph_times(bundle: Bundle, cameras: dict[str, Any]) -> dict[str, float]:
    """Return CPU milliseconds of every graph, with the inputs that a capture gives it."""
    inputs: dict[str, tuple[Any, dict[str, Any]]] = {}
    golden = golden_from_bytes(bundle.member(GOLDEN))
    for camera in cameras.values():
        original = camera.run

        def keeping(name: str, values: dict[str, Any], run: Callable[..., Any] = original) -> Any:
            inputs.setdefault(name, (run, dict(values)))
            return run(name, values)

        camera.run = keeping
        for case in bundle.manifest.golden:
            arrays = golden[case.name]
            camera.develop(arrays.capture, case.iso, case.white_balance, case.origin_px)
        facts = _capture(bundle, 1)
        inputs.pop(camera.network["graph"], None)
        camera.develop(*facts)
        camera.run = original
    times = {}
    for name, (run, values) in sorted(inputs.items()):
        seconds = [_cpu_seconds(partial(run, name, values)) for _ in range(CALLS)]
        times[name] = round(median(seconds) * 1e3, 3)
    return times


def _cpu_seconds(work: Callable[[], Any]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def _frame(bundle: Bundle, camera: Any, options: dict[str, Any], repeat: int) -> dict[str, Any]:
    """Return CPU seconds of camkit and the reader for a whole capture, interleaved."""
    facts, pairs = _capture(bundle, repeat), []
    for _ in range(1 if repeat > 1 else 3):
        ours = _cpu_seconds(lambda: _camkit(bundle, facts, **options))
        pairs.append((ours, _cpu_seconds(lambda: camera.develop(*facts))))
    ours, theirs = (median(part) for part in zip(*pairs, strict=True))
    return {
        "size": options["size"],
        "sides_px": list(facts[0].shape),
        "camkit_s": round(ours, 2),
        "reader_s": round(theirs, 2),
        "ratio": round(theirs / ours, 2),
    }


def main() -> None:
    """Measure what the command line names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("bundles", type=Path, nargs="+")
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--depth-m", type=float)
    arguments = parser.parse_args()
    repeat, depth_m = arguments.repeat, arguments.depth_m
    cameras = [measured(path, repeat, depth_m) for path in arguments.bundles]
    document = {"machine": "one thread of an AMD EPYC with 2 cores", "cameras": cameras}
    arguments.out.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
