"""Place and memory of the tone-mapped preview of a picture; free of what makes it."""

from pathlib import Path
from typing import Final

PREVIEW_SUFFIX: Final = ".preview.jpg"
LONGEST_PREVIEW_PX: Final = 1600
PREVIEW_BYTES: Final = 5 * 12 * LONGEST_PREVIEW_PX**2
"""Most memory of a preview: its planes, and what they are mapped and coded to."""


def preview_path(path: Path) -> Path:
    """Return the path of the preview of a picture."""
    return path.with_suffix(PREVIEW_SUFFIX)
