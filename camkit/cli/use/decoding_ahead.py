"""The decoder of RAW files made ready while this process still imports."""

from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, Final

PICTURE_SUFFIXES: Final = frozenset({".png", ".exr", ".hdr", ".jpg", ".jpeg", ".tif", ".tiff"})


def decoding_ahead(command: Callable[..., None]) -> Callable[..., None]:
    """Start the child that decodes before the command does anything, if its files need one.

    Args:
        command: With `files`, `scheduler`, `workers` and `dry_run`.
    """

    @wraps(command)
    def ahead(**arguments: Any) -> None:
        elsewhere = arguments["scheduler"] is not None or arguments["workers"] is not None
        if elsewhere or arguments["dry_run"] or not _needs_decoder(arguments["files"]):
            command(**arguments)
            return
        from camkit.runtime.files.decoder import decoder_ahead

        with decoder_ahead():
            command(**arguments)

    return ahead


def _needs_decoder(files: Sequence[str]) -> bool:
    """Return whether the first file is likely a RAW file: no picture, no photon counts."""
    from camkit.kinds import all_kinds

    first = Path(files[0])
    suffix = first.suffix.lower()
    others = {file_type for kind in all_kinds() for file_type in kind.file_types}
    return bool(suffix) and suffix not in PICTURE_SUFFIXES | others and first.is_file()
