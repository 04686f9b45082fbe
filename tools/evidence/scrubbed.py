"""JSON values without what differs from run to run: clocks, memory, versions, folders."""

import json
from collections.abc import Iterator, Sequence
from subprocess import CompletedProcess
from typing import Any, Final

DROPPED: Final = frozenset(
    {
        *("estimate", "expected_s", "saving_s", "s_per_24mp", "mp_per_s"),
        *("load_of_others", "noisy", "share_of_gemm_peak", "machine"),
        "camkit",  # its version
        *("output_sha256", "beside_sha256"),  # of files with dates; their samples are hashed
    }
)
DROPPED_PARTS: Final = ("seconds", "peak_rss")


def scrubbed(value: Any, folders: Sequence[str]) -> Any:
    """Return JSON values without what differs from run to run, and texts without folders."""
    if isinstance(value, dict):
        return {k: scrubbed(v, folders) for k, v in value.items() if not _is_dropped(k, v)}
    if isinstance(value, list | tuple):
        return [scrubbed(each, folders) for each in value]
    if isinstance(value, str):
        for folder in folders:
            value = value.replace(folder, "")
    return value


def _is_dropped(key: str, value: Any) -> bool:
    """Return whether a key holds a clock or its like; `stages` of a bench holds nothing else."""
    are_clocks = isinstance(value, dict) and all(isinstance(v, float) for v in value.values())
    return (
        key in DROPPED
        or any(part in key for part in DROPPED_PARTS)
        or (key == "stages" and are_clocks)
    )


def printed_values(process: CompletedProcess[str], folders: Sequence[str]) -> dict[str, Any]:
    """Return the JSON that a command printed, and how it ended."""
    values: dict[str, Any] = {"exit": process.returncode}
    values["json"] = scrubbed(list(_json_values(process.stdout)), folders)
    if process.returncode:
        values["error"] = scrubbed(process.stderr.strip().splitlines()[-1:], folders)
    return values


def _json_values(text: str) -> Iterator[Any]:
    """Yield JSON values that follow each other, and last what is none."""
    decoder = json.JSONDecoder()
    while text := text.strip():
        try:
            value, end = decoder.raw_decode(text)
        except json.JSONDecodeError:
            yield text
            return
        yield value
        text = text[end:]
