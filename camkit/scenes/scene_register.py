"""A scene by its name, `SOURCE:SEED`: a source of the register, or one that a kind brings."""

from collections.abc import Callable, Mapping
from pathlib import Path
from pkgutil import resolve_name
from typing import Final

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.kinds import all_kinds
from camkit.scenes.procedural import procedural_scene
from camkit.scenes.squares import squares_scene

Draw = Callable[[int, int, int], FloatArray]
SOURCES: Final[Mapping[str, Draw]] = {"procedural": procedural_scene, "squares": squares_scene}
"""Name -> what draws the scene of (seed, height, width); for every camera."""
MOST_DIGITS: Final = 18


def scene_sources() -> dict[str, Draw | str]:
    """Return every source by its name; that of a kind as the name of its function."""
    of_kinds = {name: place for kind in all_kinds() for name, place in kind.scenes.items()}
    return {**SOURCES, **{name: place for name, place in of_kinds.items() if name not in SOURCES}}


def is_scene_name(text: str) -> bool:
    """Return whether a text names a scene, rightly or not, and not a file."""
    source, colon, seed = text.partition(":")
    is_plausible = (
        len(source) > 1 and source.isalpha() and seed.isdigit() and not Path(text).exists()
    )
    return bool(colon) and (is_plausible or source in scene_sources())


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
    sources = scene_sources()
    if source not in sources:
        names = ", ".join(f"{names}:SEED" for names in sources)
        raise ContractError(f"there is no scene {name!r}; expected one of {names}")
    if not (seed.isascii() and seed.isdigit() and len(seed) <= MOST_DIGITS):
        raise ContractError(
            f"expected {source}:SEED with a whole number of at most {MOST_DIGITS} digits; "
            f"got {name[:60]!r}"
        )
    draw = sources[source]
    scene: FloatArray = (resolve_name(draw) if isinstance(draw, str) else draw)(
        int(seed), height, width
    )
    return scene
