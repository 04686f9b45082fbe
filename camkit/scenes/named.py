"""A scene by its name, `SOURCE:SEED`; a new source of scenes is one line of the register."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.scenes.night import night_scene
from camkit.scenes.procedural import procedural_scene
from camkit.scenes.squares import squares_scene

SOURCES: Final[Mapping[str, Callable[[int, int, int], FloatArray]]] = {
    "procedural": procedural_scene,
    "night": night_scene,
    "squares": squares_scene,
}
"""Name -> what draws the scene of (seed, height, width)."""
MOST_DIGITS: Final = 18


def is_scene_name(text: str) -> bool:
    """Return whether a text names a scene, rightly or not, and not a file."""
    source, colon, seed = text.partition(":")
    meant = len(source) > 1 and source.isalpha() and seed.isdigit() and not Path(text).exists()
    return bool(colon) and (source in SOURCES or meant)


def named_scene(name: str, height: int, width: int) -> FloatArray:
    """Return the scene of a name.

    Args:
        name: `SOURCE:SEED`, such as procedural:7.
        height: Rows in pixels.
        width: Columns in pixels.

    Returns:
        (3, height, width) float32, linear Rec.709, >= 0, 1.0 = white.

    Raises:
        ContractError: If there is no such source, the seed is no whole number >= 0, or the size is
            not positive.
    """
    source, _, seed = name.partition(":")
    if source not in SOURCES:
        known = ", ".join(f"{known}:SEED" for known in SOURCES)
        raise ContractError(f"there is no scene {name!r}; expected one of {known}")
    if not (seed.isascii() and seed.isdigit() and len(seed) <= MOST_DIGITS):
        raise ContractError(
            f"expected {source}:SEED with a whole number of at most {MOST_DIGITS} digits; "
            f"got {name[:60]!r}"
        )
    return SOURCES[source](int(seed), height, width)
