"""The machine a measurement came from, as far as it decides seconds; never its name."""

import os
import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import Any, Final

from camkit.runtime.machine.processor import processor_fact
from camkit.runtime.network.engine import available_threads, usable_providers

PACKAGES: Final = (
    *("numpy", "scipy", "onnxruntime", "opencv-python-headless", "rawpy", "OpenEXR"),
    *("tifffile", "scikit-image", "torch", "openvino"),
)
_TELLING: Final = ("sse4_2", "avx", "fma", "f16c", "amx", "neon", "asimd", "sve", "bf16", "i8mm")


def describe_machine() -> dict[str, Any]:
    """Return processor, its vector instructions, cores, memory, and the versions in use.

    Values that the system does not tell are None.
    """
    from camkit import __version__

    return {
        "camkit": __version__,
        "processor": processor_name(),
        "architecture": platform.machine(),
        "cpu_flags": telling_flags(processor_fact("flags") or processor_fact("Features") or ""),
        "cores": os.cpu_count(),
        "threads": available_threads(None),
        "memory_mb": memory_mb(),
        "system": platform.system(),
        "python": sys.version.split()[0],
        "providers": list(usable_providers()),
        "packages": {name: package_version(name) for name in PACKAGES},
    }


def processor_name() -> str:
    """Return what the processor calls itself, or else its architecture."""
    return processor_fact("model name") or platform.processor() or platform.machine()


def memory_mb() -> int | None:
    """Return the memory of the machine; None where the system does not tell."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 10**6
    except (AttributeError, ValueError, OSError):
        return None


def package_version(package: str) -> str | None:
    """Return the version of an installed package; None if it is not there."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def free_memory_bytes() -> int | None:
    """Return the memory that is free now; None where the system does not tell."""
    return _meminfo("MemAvailable")


def telling_flags(flags: str) -> list[str]:
    """Return those of a processor's flags that name its vector and matrix instructions."""
    return sorted(flag for flag in set(flags.split()) if flag.startswith(_TELLING))


def _meminfo(key: str) -> int | None:
    try:
        text = Path("/proc/meminfo").read_text(encoding="ascii")
        return int(text.split(f"{key}:", 1)[1].split(maxsplit=1)[0]) * 1024
    except (OSError, IndexError, ValueError):
        return None
