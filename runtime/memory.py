"""The peak memory of this process."""

import sys
from pathlib import Path


def peak_rss_mb() -> float:
    """Give the peak memory of this process so far, in MB; 0 where the system does not tell.

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
