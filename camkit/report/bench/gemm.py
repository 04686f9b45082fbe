"""The fastest that this machine multiplies float32 matrices: the ceiling of every network.

python -m camkit.report.bench.gemm [SECONDS]   prints GMAC/s as it finds it
"""

import subprocess
import sys
import time
from typing import Final

from camkit.errors import UnsupportedError
from camkit.runtime.files.decoder import camkit_environment

SIDE: Final = 768
"""Side of the matrices: a product is long enough to be peak, short enough to be undisturbed."""
MOST_WAIT: Final = 10
"""Times the seconds asked for, which a machine that others use may take at most."""
TIMEOUT_S: Final = 120.0
_THREAD_NAMES: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def gemm_peak_gmac_per_s(threads: int, seconds: float = 1.0) -> float:
    """Measure float32 matrix multiplication in a fresh process, so that its threads are as asked.

    Args:
        threads: Threads of the matrix library.
        seconds: Processor time to spend; the best single product counts.

    Returns:
        Thousand million multiply-adds per second.

    Raises:
        UnsupportedError: If the process fails.
    """
    environment = {**camkit_environment(), **dict.fromkeys(_THREAD_NAMES, str(threads))}
    command = [sys.executable, "-P", "-m", "camkit.report.bench.gemm", str(seconds)]
    process = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
    )
    if process.returncode:
        raise UnsupportedError(f"the matrix product could not be measured: {process.stderr[-300:]}")
    return float(process.stdout)


def best_product(side: int, seconds: float) -> float:
    """Multiply two matrices for some seconds of processor time; give the best GMAC/s."""
    import numpy as np

    rng = np.random.default_rng(0)
    left, right = (rng.random((side, side), dtype=np.float32) for _ in range(2))
    out = np.empty_like(left)
    best, began = np.inf, time.perf_counter()
    cpu_start_s = time.process_time()
    while not np.isfinite(best) or (
        time.process_time() - cpu_start_s < seconds
        and time.perf_counter() - began < MOST_WAIT * seconds
    ):
        start = time.perf_counter()
        np.matmul(left, right, out=out)
        best = min(best, time.perf_counter() - start)
    return side**3 / best / 1e9


if __name__ == "__main__":
    sys.stdout.write(f"{best_product(SIDE, float(sys.argv[1]))}\n")
