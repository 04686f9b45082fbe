"""The sidecar `NAME.camkit.json`: what was done to a picture, and proof that it is whole."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from camkit.errors import ContractError

SIDECAR_SUFFIX: Final = ".camkit.json"
SIDECAR_VERSION: Final = 1
REQUIRED: Final = frozenset(
    {
        "input",
        "input_sha256",
        "output",
        "output_sha256",
        "bundle_sha256",
        "options",
        "plan",
        "seconds",
        "peak_rss_mb",
        "clipped_fraction",
        "warnings",
    }
)
# A sidecar is a few kilobytes; anything larger is not ours.
MAX_BYTES: Final = 4_000_000


def sidecar_path(output: Path) -> Path:
    """Return the sidecar of a picture: NAME.exr -> NAME.camkit.json."""
    return output.with_name(output.stem + SIDECAR_SUFFIX)


def sidecar_text(record: Mapping[str, Any], sections: Mapping[str, Any] | None = None) -> str:
    """Return the text of a picture's sidecar.

    Args:
        record: Plain JSON values, with at least the keys of `REQUIRED`.
        sections: What stages found, each under a key of its own; they come last.

    Raises:
        ContractError: If a key is missing, a section has the name of another key, or a value is not
            JSON (NaN, inf, an object).
    """
    missing = sorted(REQUIRED - record.keys())
    if missing:
        raise ContractError(f"the sidecar lacks {', '.join(missing)}")
    whole = {"sidecar_version": SIDECAR_VERSION, **record}
    extra = dict(sections or {})
    if clashes := sorted(whole.keys() & extra.keys()):
        raise ContractError(
            f"a section of the sidecar needs a name of its own; taken: {', '.join(clashes)}"
        )
    try:
        text = json.dumps(whole | extra, indent=2, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ContractError(f"the sidecar must hold plain JSON values: {error}") from error
    return text + "\n"


def read_sidecar(output: Path) -> dict[str, Any] | None:
    """Return the record of a picture's sidecar; None if there is none that can be believed."""
    path = sidecar_path(output)
    if not path.is_file() or path.stat().st_size > MAX_BYTES:
        return None
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, ValueError, RecursionError):
        return None
    if not isinstance(record, dict) or record.get("sidecar_version") != SIDECAR_VERSION:
        return None
    return record if record.keys() >= REQUIRED else None
