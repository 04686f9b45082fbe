"""Measure what compiling the tracer costs in a first process and in a later one.

    python -m tools.comparison.compile_time LENS [--json OUT]

Two processes, one after the other, with a cache folder of their own that is empty at first: each
traces a beam of the lens in single precision, compiled, forward and with the gradient by its
curvatures, and prints the CPU-seconds of these two, its compilers included. One thread.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

import torch

from tools.comparison.tracer_speed import beam, camkit_answer, in_precision

_RAYS: Final = 2000
_ONCE: Final = "--once"


def cpu_seconds(path: Path) -> float:
    """Return the CPU-seconds of a compiled trace and its gradient in this process."""
    torch.set_num_threads(1)
    answer = camkit_answer(*in_precision(*beam(path, _RAYS), torch.float32), compiled=True)
    start = sum(os.times()[:4])
    for line in ("forward", "both"):
        answer(line)
    return sum(os.times()[:4]) - start


def processes_seconds(path: Path) -> list[float]:
    """Return the CPU-seconds of two processes, of which the second finds the first one's files."""
    command = [sys.executable, "-m", "tools.comparison.compile_time", str(path), _ONCE]
    with tempfile.TemporaryDirectory() as folder:
        places = {"XDG_CACHE_HOME": folder, "TORCHINDUCTOR_CACHE_DIR": f"{folder}/inductor"}
        environment = {**os.environ, "OMP_NUM_THREADS": "1", **places}
        runs = (
            subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
            for _ in range(2)
        )
        return [float(run.stdout.splitlines()[-1]) for run in runs]


def main() -> None:
    """Print the CPU-seconds of both processes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lens", type=Path)
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument(_ONCE, action="store_true", help="measure this process")
    arguments = parser.parse_args()
    if arguments.once:
        print(cpu_seconds(arguments.lens))
        return
    first, second = processes_seconds(arguments.lens)
    print(f"{arguments.lens.stem}: first process {first:.1f} CPU-s, second {second:.1f}")
    if arguments.json is not None:
        numbers = {"lens": arguments.lens.stem, "first_s": first, "second_s": second}
        arguments.json.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
