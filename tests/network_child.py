"""A network or a picture in a process of its own; prints the memory as JSON.

python -m tests.network_child run NAME SIDE...        windows of some sides
python -m tests.network_child picture NAME MAX_MB  a picture of 2400x800 px
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from camkit.bundle.reader import open_bundle
from camkit.runtime.machine.memory import peak_rss_mb
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from tests.network_bundle import write_network_bundle
from tests.network_graphs import GRAPHS


def run(name: str, sides: list[int]) -> dict[str, float]:
    """Run windows of a graph, twice each; return what the peak rose by, and what was counted."""
    data = GRAPHS[name]()
    found = inspect_graph(data)
    engine = NetworkEngine(data, threads=1, block_bytes=found.block_bytes_per_pixel)
    largest = max(sides)
    window = np.ones((1, 6, largest, largest), np.float32)
    out = np.ones((1, 3, largest, largest), np.float32)
    pairs = [(window[..., :s].copy(), out[..., :s].copy()) for s in sides]
    before = peak_rss_mb()
    for given, made in pairs:
        for _ in range(2):
            engine.run(given, made)
    counted = max(found.bytes_per_pixel, found.block_bytes_per_pixel)
    return {"rose_mb": peak_rss_mb() - before, "counted_mb": counted * largest**2 / 1e6}


def picture(name: str, max_mb: int) -> dict[str, float]:
    """Process noise of half the sensor, whose windows take what those of all of it take."""
    with tempfile.TemporaryDirectory() as folder:
        bundle = open_bundle(write_network_bundle(Path(folder), {"M": GRAPHS[name]()}))
    extent = bundle.manifest.sensor.known_extent
    size = extent.height_px // 2, extent.width_px
    given = np.random.default_rng(1).integers(64, 1000, size, dtype=np.uint16)
    pipeline = Pipeline(bundle, Options(threads=1, max_mem_bytes=max_mb * 10**6))
    made = pipeline.process_array(given, iso=100, white_balance=None, origin_px=(0, 0))
    return {"peak_mb": peak_rss_mb() - made.nbytes / 1e6}


if __name__ == "__main__":
    what, given, *numbers = sys.argv[1:]
    values = [int(number) for number in numbers]
    told = run(given, values) if what == "run" else picture(given, values[0])
    print(json.dumps(told))
