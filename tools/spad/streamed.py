"""A cube of photons that is larger than the memory it may take: seconds and memory of a process.

    python -m tools.spad.streamed -o docs/results/spad/streamed.json

Counts of a leaning wall behind a Gaussian pulse (16-bit, drawn), stored time axis first and pixel
by pixel, made into depth by `camkit process --bundle none` in a process of its own; how far its
times lie from the truth is told too.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from camkit.report.bench.machine import describe_machine
from camkit.runtime.kinds.spad.pulse import GaussianPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from tools.comparison.compact_json import to_compact_json

BIN_PS: Final = 16.0
SIGMA_PS: Final = 40.0
PHOTONS: Final = 200.0
BACKGROUND: Final = 0.02
DIGITS: Final = 5
FIRST: Final = "time first"
LAST: Final = "time last"


def main(words: Sequence[str] | None = None) -> None:
    """Draw, process, and write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--side", type=int, default=512)
    parser.add_argument("--bins", type=int, default=1024)
    parser.add_argument("--max-mem", default="1G")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words)
    rows = []
    with tempfile.TemporaryDirectory(prefix="camkit-streamed-") as name:
        for layout in (FIRST, LAST):
            row = measure(Path(name), arguments.side, arguments.bins, layout, arguments.max_mem)
            rows.append(row)
            print(json.dumps(row), flush=True)
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    record = {"machine": describe_machine(), "rows": rows}
    arguments.output.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")


def measure(folder: Path, side: int, bins: int, layout: str, max_mem: str) -> dict[str, Any]:
    """Return what a process took for a cube, and how near it came."""
    axis = TimeAxis.regular("histogram", bins=bins, time_bin_ps=BIN_PS)
    reach = axis.centres_ps[-1]
    y, x = np.mgrid[:side, :side] / side
    times = reach * (0.2 + 0.5 * x + 0.1 * y)
    cube = folder / "cube.h5"
    with h5py.File(cube, "w") as file:
        shape = (bins, side, side) if layout == FIRST else (side, side, bins)
        counts = file.create_dataset("histogram", shape, np.uint16)
        for row, drawn in _rows(axis, times):
            if layout == FIRST:
                counts[:, row : row + len(drawn)] = drawn.transpose(2, 0, 1)
            else:
                counts[row : row + len(drawn)] = drawn
    axes = "tyx" if layout == FIRST else "yxt"
    timing = folder / "timing.toml"
    timing.write_text(
        f'[timing]\norientation = "histogram"\ntime_bin_ps = {BIN_PS}\n'
        f'[laser]\nfwhm_ps = {SIGMA_PS * 2.3548}\n[array]\naxes = "{axes}"\n'
    )
    command = [sys.executable, "-m", "camkit", "process", str(cube), "--bundle", "none"]
    command += ["--timing", str(timing), "--out-dir", str(folder / "out"), "--max-mem", max_mem]
    done = subprocess.run(
        [*command, "--overwrite", "--json"], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"error: {done.stderr.strip()}")
    told = json.loads(done.stdout)
    result = told["results"][0] if "results" in told else told
    with np.load(folder / "out" / "cube.npz") as made:
        errors = np.abs(made["time_of_flight_ps"] - times)[made["valid"]]
        valid = float(made["valid"].mean())
    return {
        "side": side,
        "bins": bins,
        "layout": layout,
        "counts_mb": round(2 * side * side * bins / 1e6, 1),
        "max_mem": max_mem,
        "peak_rss_mb": result["peak_rss_mb"],
        "seconds": sum(result["seconds"].values()),
        "valid": valid,
        "median_error_ps": float(np.median(errors)),
    }


def _rows(axis: TimeAxis, times_ps: NDArray[np.float64]) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Return counts row by row, (1, w, bins)."""
    rng = np.random.default_rng(0)
    pulse = GaussianPulse(sigma_ps=SIGMA_PS)
    for row, of_row in enumerate(times_ps):
        every = np.broadcast_to(np.arange(axis.bins), (len(of_row), axis.bins))
        mean = PHOTONS * axis.shares(pulse, of_row, every) + BACKGROUND
        yield row, rng.poisson(mean)[None]


if __name__ == "__main__":
    main()
