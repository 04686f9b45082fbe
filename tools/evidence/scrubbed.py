"""JSON values without what differs from run to run: clocks, memory, versions, folders."""

import json
from collections.abc import Sequence
from subprocess import CompletedProcess
from typing import Any, Final

DROPPED: Final = frozenset(
    {
        *("seconds", "expected_s", "saving_s", "estimate", "peak_rss_mb"),
        "camkit",  # its version
        *("output_sha256", "beside_sha256"),  # of files with dates; their samples are hashed
    }
)


def scrubbed(value: Any, folders: Sequence[str]) -> Any:
    """Return JSON values without the keys of `DROPPED`, and texts without the names of folders."""
    if isinstance(value, dict):
        return {k: scrubbed(v, folders) for k, v in value.items() if k not in DROPPED}
    if isinstance(value, list | tuple):
        return [scrubbed(each, folders) for each in value]
    if isinstance(value, str):
        for folder in folders:
            value = value.replace(folder, "")
    return value


def told_values(told: CompletedProcess[str], folders: Sequence[str]) -> dict[str, Any]:
    """Return the JSON that a command printed, and how it ended."""
    lines = [json.loads(line) for line in told.stdout.splitlines() if line.startswith("{")]
    found: dict[str, Any] = {"json": scrubbed(lines, folders), "exit": told.returncode}
    if told.returncode:
        found["error"] = scrubbed(told.stderr.strip().splitlines()[-1:], folders)
    return found
