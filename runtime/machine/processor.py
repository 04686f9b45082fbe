"""The processor: what the system says of it, and its instructions."""

from pathlib import Path
from typing import Final

BFLOAT16_FLAGS: Final = ("avx512_bf16", "amx_bf16")
"""Flags of Linux for instructions that multiply bfloat16."""
_CPUINFO: Final = Path("/proc/cpuinfo")


def processor_fact(key: str) -> str | None:
    """Return the first value of a key in /proc/cpuinfo; None where there is none."""
    try:
        with _CPUINFO.open(encoding="utf-8") as lines:
            for line in lines:
                name, _, value = line.partition(":")
                if name.strip() == key:
                    return value.strip()
    except OSError:
        return None
    return None


def lacks_bfloat16() -> bool:
    """Return whether the processor states its instructions, and none multiplies bfloat16."""
    flags = processor_fact("flags")
    return flags is not None and not set(BFLOAT16_FLAGS) & set(flags.split())
