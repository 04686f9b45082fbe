"""Measure what docs/results/measurements.md states, and print the tables as Markdown.

python -m tools.measure speed CAPTURE.dng [--runs 3] [--sizes S,M]
python -m tools.measure tiling [--bundle duet]
python -m tools.measure precision [--bundle duet] [--sizes S,M] [--runs 5]
python -m tools.measure raws FOLDER --out-dir out/raws
"""

import argparse
import json
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import built_in_bundles, find_bundle, open_bundle
from camkit.cli.judge.doctor import examine
from camkit.runtime.network.engine import NetworkEngine, available_threads
from camkit.runtime.network.openvino_session import missing_bfloat16
from camkit.runtime.network.tiling import TileLimits, infer_bands, lay_windows
from camkit.runtime.network.windows import SizedNetwork
from camkit.runtime.rows import ArrayRows

NOKIA = ("--mosaic", "GRBG", "--black-level", "25", "--white-level", "1023")
RAW_OPTIONS = {"nokia_n900_bayer_grbg10.png": NOKIA}
TRANSFORMS = ("wiener", "network")
WAYS = (("cpu", False), ("openvino", False), ("openvino", True))
"""Provider, and whether it multiplies in bfloat16."""
TILES_PX = (192, 320, 500)


def main() -> None:
    """Run one of the measurements."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    speed = commands.add_parser("speed")
    speed.add_argument("capture", type=Path)
    speed.add_argument("--bundle", default="duet")
    speed.add_argument("--runs", type=int, default=3)
    speed.add_argument("--sizes", default="S,M")
    tiling = commands.add_parser("tiling")
    tiling.add_argument("--bundle", default=None)
    tiling.add_argument("--width", type=int, default=6000)
    tiling.add_argument("--height", type=int, default=4000)
    precision = commands.add_parser("precision")
    precision.add_argument("--bundle", default="duet")
    precision.add_argument("--sizes", default="S,M")
    precision.add_argument("--runs", type=int, default=5)
    precision.add_argument("--width", type=int, default=6000)
    precision.add_argument("--height", type=int, default=4000)
    raws = commands.add_parser("raws")
    raws.add_argument("folder", type=Path)
    raws.add_argument("--out-dir", type=Path, default=Path("out/raws"))
    arguments = parser.parse_args()
    machine = examine()
    print(f"Machine: {machine['processor']}, {machine['threads']} threads, {platform.system()}\n")
    {
        "speed": measure_speed,
        "tiling": measure_tiling,
        "precision": measure_precision,
        "raws": measure_raws,
    }[arguments.command](arguments)


def measure_speed(arguments: argparse.Namespace) -> None:
    """Measure `camkit process` to EXR in fresh processes, sizes taken in turn; medians."""
    sizes = arguments.sizes.split(",")
    runs_of_size: dict[str, list[dict[str, float]]] = {size: [] for size in sizes}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(arguments.runs):
            for size in sizes:
                words = ("--bundle", arguments.bundle, "--size", size, "--out-dir", folder)
                result = _camkit("process", str(arguments.capture), "--json", "--overwrite", *words)
                runs_of_size[size].append({**result["seconds"], "peak_mb": result["peak_rss_mb"]})
    stages = [name for name in runs_of_size[sizes[0]][0] if name != "peak_mb"]
    print("| size | " + " | ".join(stages) + " | all | neither network nor bank | peak MB |")
    print("|" + "---|" * (len(stages) + 4))
    for size, runs in runs_of_size.items():
        median = {key: statistics.median(run[key] for run in runs) for key in runs[0]}
        totals = [sum(run[name] for name in stages) for run in runs]
        rest = [sum(run[name] for name in stages if name not in TRANSFORMS) for run in runs]
        cells = [f"{median[name]:.2f}" for name in stages]
        cells += [f"{statistics.median(totals):.1f}", f"{statistics.median(rest):.1f}"]
        print(f"| {size} | " + " | ".join(cells) + f" | {median['peak_mb']:.0f} |")


def measure_tiling(arguments: argparse.Namespace) -> None:
    """Compare the planned tiling with one window, for every network of the bundles."""
    names = [arguments.bundle] if arguments.bundle else sorted(built_in_bundles())
    picture = f"{arguments.width}x{arguments.height}"
    print("| bundle | network | picture | windows | largest difference |\n|---|---|---|---|---|")
    for name in names:
        bundle = open_bundle(find_bundle(name))
        for role, sizes in bundle.manifest.networks.items():
            for size, facts in sizes.items():
                engine = NetworkEngine(
                    bundle.network_bytes(role, size),
                    threads=available_threads(None),
                    scale=facts.output_scale,
                )
                network = SizedNetwork(size=size, run=engine.run, facts=facts)
                count, worst = _tiling_error(network, arguments.height, arguments.width)
                label = size if len(bundle.manifest.networks) == 1 else f"{role} {size}"
                print(f"| {name} | {label} | {picture} | {count} | {worst:g} |")


def _tiling_error(
    network: SizedNetwork, height: int, width: int, tile_px: int | None = None
) -> tuple[int, float]:
    """Return the number of windows, and the largest difference from one window."""
    facts = network.facts
    shape = (facts.input_channels, height, width)
    planes = ArrayRows(np.random.default_rng(0).uniform(0, 3, shape).astype(np.float32))
    limits = TileLimits(
        stride_px=facts.stride_px, halo_px=facts.reach_px, cost=network.cost, tile_px=tile_px
    )
    layout = lay_windows(height, width, limits)
    whole = TileLimits(stride_px=facts.stride_px, halo_px=0, max_bytes=sys.maxsize, whole=True)
    one_layout, scale = lay_windows(height, width, whole), facts.output_scale
    bands = infer_bands(network.run, planes, one_layout, scale=scale)
    one = np.concatenate(list(bands), axis=1)
    worst, top = 0.0, 0
    for band in infer_bands(network.run, planes, layout, scale=scale):
        difference = np.abs(band - one[:, top : top + band.shape[1]])
        worst, top = max(worst, float(difference.max())), top + band.shape[1]
    return layout.window_count, worst


def measure_precision(arguments: argparse.Namespace) -> None:
    """Compare onnxruntime and openvino in float32 and bfloat16: CPU time, numbers, tiles.

    One thread; windows as planned for a picture, the ways in turn.

    Raises:
        SystemExit: If openvino or bfloat16 is missing here.
    """
    if (missing := missing_bfloat16()) is not None:
        raise SystemExit(f"bfloat16 needs {missing}")
    bundle = open_bundle(find_bundle(arguments.bundle))
    print("| network | | CPU-s of a picture | ratio | RMS from onnxruntime | tiles from whole |")
    print("|---|---|---|---|---|---|")
    for role, sizes in bundle.manifest.networks.items():
        for size in arguments.sizes.split(","):
            facts, data = sizes[size], bundle.network_bytes(role, size)
            scale = facts.output_scale
            engines = [
                NetworkEngine(data, threads=1, provider=provider, scale=scale, bfloat16=bfloat16)
                for provider, bfloat16 in WAYS
            ]
            network = SizedNetwork(size=size, run=engines[0].run, facts=facts)
            limits = TileLimits(
                stride_px=facts.stride_px, halo_px=facts.reach_px, cost=network.cost
            )
            layout = lay_windows(arguments.height, arguments.width, limits)
            shape = (facts.input_channels, layout.window_height_px, layout.window_width_px)
            window = np.random.default_rng(0).uniform(0, 3, (1, *shape)).astype(np.float32)
            seconds, outputs = _in_turn(engines, window, arguments.runs)
            for way, engine, spent_s, output in zip(WAYS, engines, seconds, outputs, strict=True):
                rms = float(np.sqrt(np.square(output - outputs[0]).mean()))
                worst = max(
                    _tiles_error(replace(network, run=engine.run), tile_px) for tile_px in TILES_PX
                )
                print(
                    f"| {size} | {way[0]} {'bf16' if way[1] else 'fp32'} | "
                    f"{spent_s * layout.window_count:.2f} | {spent_s / seconds[0]:.2f} | "
                    f"{rms:.2g} | {worst:.2g} |"
                )


def _in_turn(
    engines: list[NetworkEngine], window: FloatArray, runs: int
) -> tuple[list[float], list[FloatArray]]:
    """Return the median CPU seconds of every engine on a window, and what it gives."""
    outputs = [engine.run(window) for engine in engines]
    seconds: list[list[float]] = [[] for _ in engines]
    for _ in range(runs):
        for times, engine, output in zip(seconds, engines, outputs, strict=True):
            began = time.process_time()
            engine.run(window, output)
            times.append(time.process_time() - began)
    return [statistics.median(times) for times in seconds], outputs


def _tiles_error(network: SizedNetwork, tile_px: int) -> float:
    """Return the largest difference of tiles from one window, on a picture of some tiles."""
    return _tiling_error(network, 800, 1104, tile_px)[1]


def measure_raws(arguments: argparse.Namespace) -> None:
    """Develop every file of a folder without a bundle, and say what became of it."""
    arguments.out_dir.mkdir(parents=True, exist_ok=True)
    print("| file | result | size | CFA | black | white | seconds | notes |")
    print("|---|---|---|---|---|---|---|---|")
    for path in sorted(p for p in arguments.folder.rglob("*") if p.is_file()):
        options = RAW_OPTIONS.get(path.name, ())
        result = _camkit(
            *("process", str(path), "--bundle", "none", "--format", "png", "--overwrite"),
            *("--out-dir", str(arguments.out_dir), "--json", *options),
        )
        if not result or result["status"] != "ok":
            reason = result.get("error", "no answer") if result else "no answer"
            print(f"| {path.name} | refused | | | | | | {reason.split(': ', 1)[-1]} |")
            continue
        facts = _camkit("info", str(path), "--json", *options)
        levels = sorted(set(facts["black_level"]))
        print(
            f"| {path.name} | ok | {facts['width']}x{facts['height']} | {facts['cfa'] or 'none'} | "
            f"{', '.join(f'{v:g}' for v in levels)} | {facts['white_level']:g} | "
            f"{sum(result['seconds'].values()):.1f} | {'; '.join(result['warnings'])} |"
        )


def _camkit(*words: str) -> dict[str, Any]:
    command = [sys.executable, "-m", "camkit", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    report: dict[str, Any] = json.loads(done.stdout) if done.stdout.strip() else {}
    return report


if __name__ == "__main__":
    main()
