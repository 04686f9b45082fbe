"""Two recipes made of one: the camera before a display, and the same camera outside.

    display   codes of 8 bits, black at a thousandth of white, primaries that the colour matrix sees
              elsewhere than Rec.709 has them; one distance, one exposure, no lamps
    wild      daylight of 4000 to 12000 K, white 4 to 64 times as bright, other distances if asked

Both are texts with a comment: a recipe as a person would have edited it. A third and a fourth,
NAME_display_judged.toml and NAME_wild_judged.toml, are what is judged: pictures alone, since scenes
that are drawn are the same ones as in training; where lenses have a haze, frames of their own with
few tiles of each, and copies of the lens that no network was trained on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from camkit.errors import ContractError
from tools.tables.recipe_text import with_keys

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
JUDGED: Final = "_judged"
PICTURES_ALONE: Final = {"picture_share": 1.0, "edge_share": 0.0, "night_share": 0.0}
"""Of the scenes to judge on."""
JUDGED_TILES: Final = 12
"""Of a shot: samples of one frame are alike, so many frames count for more."""
OTHER_COPIES: Final = 907
"""Seed of copies of the lens to judge on."""
LOSSES: Final = "[schedule]"
"""With this table begins what sizes and losses a recipe has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Frames that are photographed through a lens with a haze.

    Attributes:
        frames: To train on.
        judged: To judge on.
        copies: Of the lens, for each, outside not fewer than distances; one more to choose by.
    """

    frames: int
    judged: int
    copies: int = 1


def write_twins(
    recipe: Path,
    folder: Path,
    depths_mm: Sequence[float] = (),
    *,
    camera: Path | None = None,
    counts: Counts | None = None,
) -> tuple[Path, Path]:
    """Write both recipes; a text that is there and the same stays.

    Args:
        recipe: Of the camera, its lens by name.
        folder: For NAME_display.toml and NAME_wild.toml.
        depths_mm: Distances of scenes outside, increasing; empty for the one of the lens.
        camera: Recipe of another camera, NAME; of the first one sizes and losses are taken.
        counts: Of a lens with a haze; None for those of the recipe.

    Raises:
        ContractError: If a recipe cannot be read, or has no table that must be changed.
    """
    text = _read(recipe)
    if camera is not None:
        text = with_losses(_read(camera), text)
    if counts is not None:
        text = with_keys(text, "frames", {"count": counts.frames, "validation_count": 1})
        text = with_keys(text, "lens", {"copies": counts.copies})
    outside = text
    if depths_mm:
        outside = with_keys(text, "lens", {"depths_mm": list(depths_mm), "bank_in_focus": True})
        if counts is not None:  # frames see one distance through one copy
            copies = max(counts.copies, len(depths_mm))
            outside = with_keys(outside, "lens", {"copies": copies})
    written = []
    for name, content in (
        ("display", with_keys(text, "data", LABORATORY) + DISPLAY),
        ("wild", outside + WILD),
    ):
        path = folder / f"{(camera or recipe).stem}_{name}.toml"
        path.write_text(content, encoding="utf-8")
        written.append(path)
        judged = with_keys(content, "data", PICTURES_ALONE)
        if counts is not None:
            frames = {"count": counts.judged, "tiles": JUDGED_TILES}
            judged = with_keys(judged, "frames", frames)
            judged = with_keys(judged, "lens", {"seed": OTHER_COPIES})
        judged_by(path).write_text(judged, encoding="utf-8")
    return written[0], written[1]


def judged_by(recipe: Path) -> Path:
    """Return where the recipe of samples to judge on lies, beside that of a network."""
    return recipe.with_name(f"{recipe.stem}{JUDGED}{recipe.suffix}")


def with_losses(camera: str, losses: str) -> str:
    """Return the text of a camera's recipe with schedule, sizes and losses of another recipe.

    Raises:
        ContractError: If one of them has no table `[schedule]`.
    """
    (before, _), (_, after) = _parted(camera), _parted(losses)
    return f"{before}\n{after}"


def _parted(text: str) -> tuple[str, str]:
    """Return what lies before the schedule of a recipe, and the rest with the comment above it."""
    lines = text.splitlines()
    if LOSSES not in lines:
        raise ContractError(f"the recipe has no table {LOSSES}")
    at = lines.index(LOSSES)
    while at > 0 and lines[at - 1].startswith("#"):
        at -= 1
    return "\n".join(lines[:at]).rstrip() + "\n", "\n".join(lines[at:]) + "\n"


def _read(recipe: Path) -> str:
    try:
        return recipe.read_text(encoding="utf-8")
    except OSError as error:
        raise ContractError(f"cannot read recipe {recipe}: {error.strerror}") from error
