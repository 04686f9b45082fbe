"""The peak memory of this process, and arrays that lie in a file instead."""

import ctypes
import mmap
import os
import sys
import threading
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray


def peak_rss_mb() -> float:
    """Return the peak memory of this process so far, in MB; 0 where the system does not tell.

    On Linux getrusage would also count what the parent held before exec, so the kernel's own
    high-water mark is read there.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return int(status.split("VmHWM:", 1)[1].split(maxsplit=1)[0]) * 1024 / 1e6
    except (OSError, IndexError, ValueError):
        return _max_rss_mb()


def _max_rss_mb() -> float:
    try:
        import resource
    except ImportError:
        return 0.0
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def trim_heap(limit_bytes: int) -> None:
    """Release freed memory to the system where the process takes more than a limit.

    The C library keeps what was freed between two blocks in use: up to a quarter of the memory of
    a large picture. Giving it back costs milliseconds, so it is done near the limit only. Nothing
    happens where the C library is not glibc.
    """
    if _LIBC is not None and _resident_bytes() > limit_bytes:
        _LIBC.malloc_trim(0)


def keep_freed_memory() -> None:
    """Undo a small MALLOC_TRIM_THRESHOLD_ of the environment, as dask gives its workers.

    With it every array that is freed goes back to the system and every new one comes in page by
    page: block filters take twice as long. The thresholds set here are those that glibc would come
    to by itself; what it keeps is given back by `trim_heap`.
    """
    threshold = os.environ.get("MALLOC_TRIM_THRESHOLD_", "")
    if _LIBC is not None and threshold.isdecimal() and int(threshold) < _KEPT_BYTES:
        _LIBC.mallopt(_M_MMAP_THRESHOLD, _KEPT_BYTES // 2)
        _LIBC.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)


def keep_memory_for_good() -> None:
    """Keep all memory for the arrays to come, in a process that does nothing else and then ends.

    All threads share one heap, and what is freed stays in it. Otherwise freed arrays go back to the
    system and new ones come in page by page, each cleared first: a fifth of the time of a large
    photograph. To be called before threads are started; `trim_heap` still gives back.
    """
    if _LIBC is not None:
        _LIBC.mallopt(_M_ARENA_MAX, 1)
        _LIBC.mallopt(_M_MMAP_THRESHOLD, _KEPT_BYTES // 2)
        _LIBC.mallopt(_M_TRIM_THRESHOLD, _MOST_KEPT_BYTES)


class _MappedArrays:
    """Gives every large array a mapping of its own while anybody asks for it; see `mapped_arrays`.

    What is set holds for the whole process, so callers of several threads are counted.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._callers = 0

    def __enter__(self) -> None:
        with self._lock:
            self._callers += 1
            if self._callers == 1 and _LIBC is not None:
                _LIBC.mallopt(_M_MMAP_THRESHOLD, _MAPPED_BYTES)

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._callers -= 1
            if self._callers == 0 and _LIBC is not None:
                _LIBC.mallopt(_M_MMAP_THRESHOLD, _KEPT_BYTES // 2)
                _LIBC.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)


def _resident_bytes() -> int:
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except (OSError, IndexError, ValueError):
        return 0
    return pages * mmap.PAGESIZE


def _glibc() -> ctypes.CDLL | None:
    if sys.platform != "linux":
        return None
    try:
        library = ctypes.CDLL(None)
        _ = library.malloc_trim, library.mallopt
    except (OSError, AttributeError):
        return None
    return library


_LIBC: Final = _glibc()
_M_TRIM_THRESHOLD: Final = -1
_M_MMAP_THRESHOLD: Final = -3
_M_ARENA_MAX: Final = -8
_KEPT_BYTES: Final = 64 * 2**20
"""glibc's own threshold grows up to here (mallopt(3))."""
_MOST_KEPT_BYTES: Final = 2**30
_MAPPED_BYTES: Final = 256 * 2**10
mapped_arrays: Final = _MappedArrays()
"""Context in which arrays go back to the system as soon as they are freed.

Otherwise the C library keeps those of up to 32 MB in its heap, where arrays of many sizes leave
holes. It costs fresh pages for every array. Nothing happens where the C library is not glibc.
"""


def mapping_of(samples: NDArray[Any]) -> mmap.mmap | None:
    """Return the file mapping that an array is a view of; None for an array in memory."""
    owner: Any = samples
    while isinstance(owner, np.ndarray):
        owner = owner.base
    return owner if isinstance(owner, mmap.mmap) else None


def release_pages(samples: NDArray[Any]) -> None:
    """Release the pages of a mapped array; they are read again when they are asked for."""
    mapping = mapping_of(samples)
    if mapping is not None and hasattr(mmap, "MADV_DONTNEED"):
        mapping.madvise(mmap.MADV_DONTNEED)
