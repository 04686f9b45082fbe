"""Every stage of a photograph beside the least that this machine could take for it.

    python -m tools.stage_limits CAPTURE.dng [--size S] [--runs 3] -o docs/results/stages.json

CPU-seconds on one thread, the median of runs, each in a process of its own as `camkit process` has
it. The limit of a pointwise stage is that of reading and writing its samples once from and to
memory, at the speed of a plain copy; that of the bank, the bare Fourier transforms of its blocks;
that of the network, its multiplications at the speed of a matrix product; that of undistortion, the
bare interpolation of its planes. A stage that works in a cache can be below the first.
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.stages import Wiener
from camkit.report.bench.gemm import gemm_peak_gmac_per_s
from camkit.report.bench.machine import describe_machine
from camkit.runtime.bank.blocks import lay_spans
from tools.stage_profile import run_again
from tools.tables.records import to_compact_json

RAW, PLANE = 2, 4
"""Bytes of a raw value, and of a float32."""
POINTWISE: Final = {
    "linearise": RAW + PLANE,
    "repair": 2 * PLANE,
    "demosaic": 4 * PLANE,
    "raise_clipped": 6 * PLANE,
    "illumination": 6 * PLANE,
    "color": 6 * PLANE,
}
"""Bytes that a stage reads and writes for a pixel."""
COPY_BYTES: Final = 256 * 2**20
SIDE_PX: Final = 1024
ROUNDS: Final = 9
DIGITS: Final = 4


def main(words: Sequence[str] | None = None) -> None:
    """Measure, print a table and write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("capture", type=Path)
    parser.add_argument("--bundle", default="duet")
    parser.add_argument("--size", default="S")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words, argparse.Namespace(format="exr", method=None, threads=1))
    runs = [json.loads(run_again(once(arguments))) for _ in range(arguments.runs)]
    bundle = open_bundle(find_bundle(arguments.bundle))
    size_px = runs[0]["size_px"]
    least = limits(bundle, arguments.size, (size_px[0], size_px[1]))
    stages = {
        name: {
            "cpu_s": statistics.median(run["cpu"].get(name, 0.0) for run in runs),
            "limit_s": limit_s,
        }
        for name, limit_s in least.items()
    }
    record = {
        "machine": describe_machine(),
        "bundle": bundle.manifest.name,
        "size": arguments.size,
        "size_px": size_px,
        "stages": stages,
    }
    arguments.output.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")
    print(table(stages))


def once(arguments: argparse.Namespace) -> argparse.Namespace:
    """Return the choices of one run of `stage_profile`."""
    return argparse.Namespace(**{**vars(arguments), "runs": 0})


def limits(bundle: Bundle, size: str, size_px: tuple[int, int]) -> dict[str, float]:
    """Return stage -> the least CPU-seconds for a photograph of (width, height) pixels."""
    pixels = size_px[0] * size_px[1]
    copied = pixels / copy_bytes_per_s()
    facts = bundle.network_facts(next(iter(bundle.manifest.networks)), size)
    least = {name: count * copied for name, count in POINTWISE.items()}
    least["undistort"] = 3 * pixels * interpolation_s_per_px()
    least["network"] = facts.mac_per_pixel * pixels / gemm_peak_gmac_per_s(1) / 1e9
    bank = bundle.manifest.stage(Wiener)
    if bank is not None:
        blocks = [len(lay_spans(side, bank.block_px, bank.overlap_px)) for side in size_px]
        least["wiener"] = blocks[0] * blocks[1] * 6 * transform_s(bank.block_px)
    return least


def copy_bytes_per_s() -> float:
    """Return the bytes read and written in a second by a plain copy of a large array."""
    source = np.ones(COPY_BYTES // PLANE, np.float32)
    target = np.zeros_like(source)
    return 2 * COPY_BYTES / _least_cpu_s(lambda: np.copyto(target, source))


def transform_s(side_px: int) -> float:
    """Return the CPU-seconds of a Fourier transform of one plane of a block, in the cache."""
    plane = np.ones((side_px, side_px), np.float32)
    packed = np.empty_like(plane)
    return _least_cpu_s(lambda: cv2.dft(plane, dst=packed), calls=20) / 20


def interpolation_s_per_px() -> float:
    """Return the CPU-seconds of one sample between pixels by the Lanczos filter."""
    plane = np.ones((SIDE_PX, SIDE_PX), np.float32)
    rows, columns = np.indices(plane.shape, np.float32)
    maps = cv2.convertMaps(columns * 0.99 + 3.3, rows * 0.99 + 3.3, cv2.CV_16SC2)
    result = np.empty_like(plane)
    call: Callable[[], object] = lambda: cv2.remap(  # noqa: E731
        plane, *maps, cv2.INTER_LANCZOS4, dst=result, borderMode=cv2.BORDER_REPLICATE
    )
    return _least_cpu_s(call) / SIDE_PX**2


def _least_cpu_s(call: Callable[[], object], calls: int = 1) -> float:
    """Return the least CPU-seconds of some calls on one thread."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    seconds = []
    for _ in range(ROUNDS):
        began = time.process_time()
        for _ in range(calls):
            call()
        seconds.append(time.process_time() - began)
    cv2.setNumThreads(threads)
    return min(seconds)


def table(stages: dict[str, Any]) -> str:
    """Return the stages as a Markdown table, the longest first."""
    rows = ["| stage | CPU-s | limit, CPU-s | times the limit |", "|---|---|---|---|"]
    for name, one in sorted(stages.items(), key=lambda item: -item[1]["cpu_s"]):
        ratio = one["cpu_s"] / max(one["limit_s"], 1e-9)
        rows.append(f"| {name} | {one['cpu_s']:.2f} | {one['limit_s']:.2f} | {ratio:.1f} |")
    return "\n".join(rows)


if __name__ == "__main__":
    main()
