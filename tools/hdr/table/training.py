"""The networks of the tables: one after the other, each for the same CPU time, resumable.

Each seed has samples of its own: they decide how well a network does as much as its first weights.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from camkit.errors import ContractError
from tools.comparison.equal_training import (
    EqualTime,
    Tell,
    Trainee,
    checkpoint_in,
    trained,
)
from tools.comparison.equal_training import finished as finished_in
from tools.hdr.table.cameras import RECIPES, material_of
from tools.hdr.table.rows import Row, Run

PLATE_LINE: Final = re.compile(r'^file = ".*"$', re.MULTILINE)
SCHEDULE_LINE: Final = "[schedule]\n"
LACKS_VGG: Final = "needs weights of VGG-19: give --vgg FILE"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainSettings:
    """What every network of the tables is trained with.

    Attributes:
        time: The same for all.
        vgg: Weights of VGG-19; rows that need them are left out without.
    """

    time: EqualTime
    vgg: Path | None = None


def train_rows(rows: Iterable[Row], settings: TrainSettings, tell: Tell) -> None:
    """Train whatever is not trained yet.

    Raises:
        ContractError: If something was trained for another time.
    """
    for run in (run for row in rows if row.recipe for run in row.runs):
        if run.row.needs_vgg and settings.vgg is None:
            tell(f"{run.name}: left out: {LACKS_VGG}")
            continue
        trained(_trainee(run, settings), settings.time, tell)


def finished(out_dir: Path, run: Run) -> dict[str, Any] | None:
    """Return how a training ended; None where it did not."""
    return finished_in(out_dir / run.name)


def checkpoint_of(out_dir: Path, run: Run) -> Path:
    """Return the file that a training wrote."""
    return checkpoint_in(out_dir / run.name, run.row.size, run.row.role)


def recipe_text(run: Run) -> str:
    """Return the shipped recipe of a row with its plate and seed in place of its own.

    Raises:
        ContractError: If the recipe does not say both where it is expected.
    """
    assert run.row.recipe is not None
    shipped = (RECIPES / run.row.recipe).read_text(encoding="utf-8")
    text, plates = PLATE_LINE.subn(f'file = "{run.row.plate}"', shipped)
    if plates != 1 or text.count(SCHEDULE_LINE) != 1:
        raise ContractError(f"{run.row.recipe} must have one [schedule] and one line file = ...")
    return text.replace(SCHEDULE_LINE, f"{SCHEDULE_LINE}seed = {run.seed}\n")


def _trainee(run: Run, settings: TrainSettings) -> Trainee:
    return Trainee(
        name=run.name,
        recipe=recipe_text(run),
        size=run.row.size,
        role=run.row.role,
        material=lambda: material_of(run.row.plate),
        vgg=settings.vgg if run.row.needs_vgg else None,
    )
