"""Two recipes made of one: the camera before a display, and the same camera outside.

    display   codes of 8 bits, black at a thousandth of white, primaries that the colour matrix sees
              elsewhere than Rec.709 has them; one distance, one exposure, no lamps
    wild      daylight of 4000 to 12000 K, white 4 to 64 times as bright, other distances if asked

Both are texts with a comment: a recipe as a person would have edited it.
"""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from camkit.errors import ContractError
from camkit.models_def.toml_table import key_line

DISPLAY: Final = """
# A laboratory: a display with the primaries of DCI-P3 shows pictures that are coded as sRGB.
[data.display]
primaries = [[0.68, 0.32], [0.265, 0.69], [0.15, 0.06]]
white = [0.3127, 0.329]
contrast = 1000.0
bits = 8
gamma = 2.2
calibrated = false
"""
WILD: Final = """
# Outside: daylight from 4000 to 12000 K, white 4 to 64 times as bright as that of a picture.
[data.wild]
daylight_warmest_k = 4000.0
daylight_coldest_k = 12000.0
range_least = 4.0
range_most = 64.0
"""
LABORATORY: Final = {"exposure_min_ev": 0.0, "exposure_max_ev": 0.0, "lamp_share": 0.0}

Value = str | float | bool | Sequence[str | float]


def write_twins(recipe: Path, folder: Path, depths_mm: Sequence[float] = ()) -> tuple[Path, Path]:
    """Write both recipes; a text that is there and the same stays.

    Args:
        recipe: Of the camera, its lens by name.
        folder: For NAME_display.toml and NAME_wild.toml.
        depths_mm: Distances of scenes outside, increasing; empty for the one of the lens.

    Raises:
        ContractError: If the recipe cannot be read, or has no table that must be changed.
    """
    try:
        text = recipe.read_text(encoding="utf-8")
    except OSError as error:
        raise ContractError(f"cannot read recipe {recipe}: {error.strerror}") from error
    outside = text
    if depths_mm:
        outside = with_keys(text, "lens", {"depths_mm": list(depths_mm), "bank_in_focus": True})
    written = []
    for name, content in (
        ("display", with_keys(text, "data", LABORATORY) + DISPLAY),
        ("wild", outside + WILD),
    ):
        path = folder / f"{recipe.stem}_{name}.toml"
        path.write_text(content, encoding="utf-8")
        written.append(path)
    return written[0], written[1]


def with_keys(text: str, table: str, keys: Mapping[str, Value]) -> str:
    """Give the text of a recipe with other values of keys of a table, each on a line of its own.

    Raises:
        ContractError: If there is no such table, or the values do not come out.
    """
    lines, inside, found = [], False, False
    for line in text.splitlines():
        if line.startswith("["):
            inside = line.strip() == f"[{table}]"
        if not (inside and line.split("=")[0].strip() in keys):
            lines.append(line)
        if inside and line.startswith("["):
            found = True
            lines += [key_line(key, value) for key, value in keys.items()]
    changed = "\n".join(lines) + "\n"
    if not found:
        raise ContractError(f"the recipe has no table [{table}]")
    try:
        given = tomllib.loads(changed)[table]
    except tomllib.TOMLDecodeError as error:
        raise ContractError(f"[{table}] holds one of {', '.join(keys)} on many lines") from error
    if any(given[key] != value for key, value in keys.items()):
        raise ContractError(f"[{table}] holds one of {', '.join(keys)} twice")
    return changed
