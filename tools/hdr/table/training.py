"""The networks of the tables: one after the other, each for the same CPU time, resumable.

    DIR/streak-4.network-2/recipe.toml, checkpoint, log, samples (gone when it is done), done.json

CPU time is that of the trainer and of the processes that make its samples. Each seed has samples of
its own: they decide how well a network does as much as its first weights.
"""

import json
import re
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from camkit.errors import ContractError
from camkit.models_def.training.kind import read_recipe
from camkit.models_def.training.trainer import TrainOptions, checkpoint_path, train
from camkit.runtime.output.part_file import atomic_output
from tools.hdr.table.cameras import RECIPES, material_of
from tools.hdr.table.rows import Row, Run

DONE: Final = "done.json"
RECIPE: Final = "recipe.toml"
SAMPLES: Final = "samples_*"
AT_THE_END_S: Final = 1e9
"""Between validations: they would take of the time that is the same for all."""
PLATE_LINE: Final = re.compile(r'^file = ".*"$', re.MULTILINE)
SCHEDULE_LINE: Final = "[schedule]\n"
LACKS_VGG: Final = "needs weights of VGG-19: give --vgg FILE"

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainSettings:
    """What every network of the tables is trained with.

    Attributes:
        out_dir: A folder for every run is made there.
        pictures: To train on.
        cpu_minutes: For each, its samples included.
        vgg: Weights of VGG-19; rows that need them are left out without.
        workers: Processes that make samples.
    """

    out_dir: Path
    pictures: Path | None
    cpu_minutes: float = 15.0
    vgg: Path | None = None
    workers: int = 1


def train_rows(rows: Iterable[Row], settings: TrainSettings, tell: Tell) -> None:
    """Train whatever is not trained yet.

    Raises:
        ContractError: If something was trained for another time.
    """
    for run in (run for row in rows if row.recipe for run in row.runs):
        if run.row.needs_vgg and settings.vgg is None:
            tell(f"{run.name}: left out: {LACKS_VGG}")
            continue
        known = finished(settings.out_dir, run)
        if known is None:
            tell(f"{run.name}: training for {settings.cpu_minutes:g} CPU-minutes")
            known = _train(run, settings)
        elif known["cpu_minutes"] != settings.cpu_minutes:
            raise ContractError(
                f"{run.name} was trained for {known['cpu_minutes']:g} CPU-minutes, not "
                f"{settings.cpu_minutes:g}: say so, or remove {settings.out_dir / run.name}"
            )
        tell(
            f"{run.name}: {known['steps']} steps, {known['cpu_s']:.0f} CPU-s, "
            f"{known['valid_db']:.2f} dB on fixed samples"
        )


def finished(out_dir: Path, run: Run) -> dict[str, Any] | None:
    """Give how a training ended; None where it did not."""
    path = out_dir / run.name / DONE
    if not path.is_file():
        return None
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def checkpoint_of(out_dir: Path, run: Run) -> Path:
    """Give the file that a training wrote."""
    folder = out_dir / run.name
    options = TrainOptions(out_dir=folder, size=run.row.size, role=run.row.role)
    return checkpoint_path(read_recipe(folder / RECIPE), options, None)


def recipe_text(run: Run) -> str:
    """Give the shipped recipe of a row with its plate and seed in place of its own.

    Raises:
        ContractError: If the recipe does not say both where it is expected.
    """
    assert run.row.recipe is not None
    shipped = (RECIPES / run.row.recipe).read_text(encoding="utf-8")
    text, plates = PLATE_LINE.subn(f'file = "{run.row.plate}"', shipped)
    if plates != 1 or text.count(SCHEDULE_LINE) != 1:
        raise ContractError(f"{run.row.recipe} must have one [schedule] and one line file = ...")
    return text.replace(SCHEDULE_LINE, f"{SCHEDULE_LINE}seed = {run.seed}\n")


def _train(run: Run, settings: TrainSettings) -> dict[str, Any]:
    folder = settings.out_dir / run.name
    folder.mkdir(parents=True, exist_ok=True)
    recipe = folder / RECIPE
    with atomic_output(recipe) as part:
        part.write_text(recipe_text(run), encoding="utf-8")
    options = TrainOptions(
        out_dir=folder,
        size=run.row.size,
        role=run.row.role,
        data_folder=settings.pictures,
        max_cpu_minutes=settings.cpu_minutes,
        resume=checkpoint_of(settings.out_dir, run).exists(),
        workers=settings.workers,
        vgg=settings.vgg if run.row.needs_vgg else None,
        validate_s=AT_THE_END_S,
    )
    result = train(recipe, options, material=material_of(run.row.plate))
    found = {
        "cpu_minutes": settings.cpu_minutes,
        "cpu_s": round(result.cpu_s, 1),
        "steps": result.steps,
        "valid_db": round(result.valid_db, 3),
    }
    with atomic_output(folder / DONE) as part:
        part.write_text(json.dumps(found) + "\n", encoding="utf-8")
    for samples in folder.glob(SAMPLES):
        shutil.rmtree(samples)
    return found
