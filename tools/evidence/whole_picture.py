"""The child of `seconds --whole`: one large photograph by the camkit of a checkout, without files.

    python -c BOOT HERE tools.evidence.whole_picture CAPTURE BUNDLE SIZE THREADS

prints as JSON the CPU-seconds and the seconds from the capture in memory to the last row, the peak
of the process in MB and the sum of a part of the picture, which tells whether two checkouts agree.
"""

import json
import sys
import time

import camkit.cli  # first: it sets what the command line sets for numpy
from camkit.runtime.machine import memory
from camkit.runtime.pipeline import load

assert camkit.cli


def main(words: list[str]) -> None:
    """Process a capture and print what it took."""
    capture, bundle, size, threads = words
    # as the command line does where it is new enough
    getattr(memory, "keep_memory_for_good", lambda: None)()
    pipeline = load(bundle, size=size, threads=int(threads))
    job = pipeline.start(pipeline.read(capture))
    cpu_s, clock_s, total = time.process_time(), time.perf_counter(), 0.0
    for band in job.bands():
        total += float(band[0, ::16, ::16].sum())
    answer = {
        "cpu_s": time.process_time() - cpu_s,
        "clock_s": time.perf_counter() - clock_s,
        "peak_mb": memory.peak_rss_mb(),
        "sum": total,
    }
    print(json.dumps(answer))


if __name__ == "__main__":
    main(sys.argv[-4:])
