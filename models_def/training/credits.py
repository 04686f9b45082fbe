"""The training data of weights, in words, for the card of a bundle."""

import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from camkit.models_def.training.pictures import list_pictures
from camkit.models_def.training.recipe import DataRecipe

ROW = re.compile(r"^\| `(?P<file>[^`]+)` \|(?P<rest>.*)\|$")
LICENCE_COLUMN = 2
FIRST_WEIGHTS: Final = "; first weights: "


def describe_data(data: DataRecipe, pictures: Path | None) -> str:
    """Describe the training data: folder, number and licences of pictures, procedural share.

    Licences are read from the table of the folder's README.md (columns file, title, author,
    licence), where there is one.
    """
    scenes = f"{data.procedural_scenes} procedural scenes (camkit.scenes)"
    if pictures is None:
        return f"{scenes} only; no photographs"
    files = list_pictures(pictures)
    share = 100 * data.picture_share
    licences = _licences(pictures / "README.md", {p.name for p in files})
    licence_text = ", ".join(f"{name}: {count}" for name, count in sorted(licences.items()))
    return (
        f"{len(files)} photographs of {pictures.name} ({share:.0f} % of the samples; "
        f"licences {licence_text or 'not stated'}) and {scenes}"
    )


def joined_credits(texts: Iterable[str]) -> str:
    """Join what the networks of a bundle were trained on: what they share is said once.

    Parts of one training that each began at the one before name the same first weights again.
    """
    heads: dict[str, dict[str, None]] = {}
    for text in texts:
        head, *tails = text.split(FIRST_WEIGHTS)
        heads.setdefault(head, {}).update(dict.fromkeys(tails))
    return "; ".join(
        head + "".join(FIRST_WEIGHTS + tail for tail in tails) for head, tails in heads.items()
    )


def _licences(readme: Path, names: set[str]) -> Counter[str]:
    """Count the licences of the named files, without their remarks in brackets."""
    licences: Counter[str] = Counter()
    if not readme.is_file():
        return licences
    for line in readme.read_text(encoding="utf-8").splitlines():
        row = ROW.match(line.strip())
        if row is None or row["file"] not in names:
            continue
        cells = [cell.strip() for cell in row["rest"].split("|")]
        if len(cells) > LICENCE_COLUMN:
            licences[cells[LICENCE_COLUMN].split(" (")[0]] += 1
    return licences
