"""The peak memory is that of this process, not of the one that started it."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from camkit.runtime.machine import memory


def test_a_large_array_raises_the_peak() -> None:
    code = (
        "import numpy as np; from camkit.runtime.machine.memory import peak_rss_mb\n"
        "before = peak_rss_mb(); held = np.ones(20_000_000); print(peak_rss_mb() - before)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert 150 < float(told.stdout) < 200


@pytest.mark.skipif(sys.platform != "linux", reason="reads the kernel's high-water mark")
def test_a_child_does_not_inherit_the_peak_of_its_parent() -> None:
    held = np.ones(40_000_000)
    code = "from camkit.runtime.machine.memory import peak_rss_mb; print(peak_rss_mb())"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert float(told.stdout) < 200
    del held


def test_without_the_mark_getrusage_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory.Path, "read_text", lambda *_, **__: "")
    assert memory.peak_rss_mb() > 10


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system does not tell")
def test_freed_memory_is_given_back_near_the_limit_only() -> None:
    """In a process of its own: small blocks pin the heap between large ones that are freed."""
    done = subprocess.run([sys.executable, "-c", HOLES], capture_output=True, text=True, check=True)
    held, unasked, given_back = map(int, done.stdout.split())
    assert held > 30e6  # of 98; a system may put cold pages aside meanwhile
    assert unasked > 0.9 * held
    assert given_back < 0.5 * held


@pytest.mark.skipif(memory._LIBC is None, reason="no glibc")
def test_a_threshold_that_gives_every_array_back_is_undone() -> None:
    """As dask's nanny sets it: then memory that is freed and taken again is not paged in anew."""
    env = {**os.environ, "MALLOC_TRIM_THRESHOLD_": "65536"}
    faults = [
        int(
            subprocess.run(
                [sys.executable, "-c", PAGES, undo],
                capture_output=True,
                text=True,
                check=True,
                env=env,
            ).stdout
        )
        for undo in ("", "undo")
    ]
    assert faults[0] > 10_000
    assert faults[1] < 0.2 * faults[0]


@pytest.mark.skipif(memory._LIBC is None, reason="no glibc")
def test_a_process_of_camkit_s_own_keeps_what_its_threads_free() -> None:
    """Arrays of threads that follow one another take the pages of those before them."""
    apart, shared = (
        int(
            subprocess.run(
                [sys.executable, "-c", THREADS, keep], capture_output=True, text=True, check=True
            ).stdout
        )
        for keep in ("", "keep")
    )
    assert shared < 0.5 * apart  # the first touch of 96 MB among them


THREADS = """
import resource, sys
from concurrent.futures import ThreadPoolExecutor
import numpy as np
from camkit.runtime.machine import memory

if sys.argv[1]:
    memory.keep_memory_for_good()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    with ThreadPoolExecutor(1) as pool:
        list(pool.map(lambda _: [np.ones(2_000_000) for _ in range(6)], range(1)))
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
PAGES = """
import resource, sys
import numpy as np
from camkit.runtime.machine.memory import keep_freed_memory
if sys.argv[1]:
    keep_freed_memory()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(100):
    np.ones(1_000_000)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
HOLES = """
import ctypes
from camkit.runtime.machine import memory
libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
libc.free.argtypes = [ctypes.c_void_p]
before = memory._resident_bytes()
large, small = [], []
for _ in range(1000):
    large.append(libc.malloc(100_000))
    libc.memset(ctypes.c_void_p(large[-1]), 1, 100_000)
    small.append(libc.malloc(64))
for block in large:
    libc.free(block)
held = memory._resident_bytes() - before
memory.trim_heap(10**12)
unasked = memory._resident_bytes() - before
memory.trim_heap(0)
print(held, unasked, memory._resident_bytes() - before)
"""
