"""A network trained for a given CPU time, in a folder of its own; what is done is not done again.

    FOLDER/recipe.toml, checkpoint, log, samples (gone when it is done), done.json

CPU time is that of the trainer and of the processes that make its samples.
"""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from camkit.errors import ContractError
from camkit.models_def.training.kind import Material, read_recipe
from camkit.models_def.training.trainer import TrainOptions, checkpoint_path, train
from camkit.runtime.output.part_file import atomic_output
from tools.tables.table_rows import Run

DONE_FILE: Final = "done.json"
RECIPE: Final = "recipe.toml"
SAMPLES: Final = "samples_*"
AT_THE_END_S: Final = 1e9
"""Between validations: they would take of the time that is the same for all."""

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class EqualTime:
    """Settings that every network of a comparison is trained with.

    Attributes:
        out_dir: A folder for every run is made there.
        pictures: To train on.
        cpu_minutes: For each, its samples included.
        steps: At which a schedule would end; None for the recipe's.
        workers: Processes that make samples.
    """

    out_dir: Path
    pictures: Path | None
    cpu_minutes: float = 15.0
    steps: int | None = None
    workers: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Trainee:
    """A network to train.

    Attributes:
        run: The row and its seed.
        recipe: Text of it.
        material: What the recipe's optics are.
        vgg: Weights of VGG-19, where its loss looks at them.
        sharp: Sharp pictures, where its loss has a critic.
        valid: Pictures to validate on at the end; None for procedural ones.
    """

    run: Run
    recipe: str
    material: Callable[[], Material]
    vgg: Path | None = None
    sharp: Path | None = None
    valid: Path | None = None


def trained(one: Trainee, settings: EqualTime, tell: Tell) -> dict[str, Any]:
    """Train a network unless it is trained; say how it ended.

    Raises:
        ContractError: If it was trained for another time, or begun by another recipe.
    """
    name = one.run.training
    folder = settings.out_dir / name
    ending, begun = finished(folder), folder / RECIPE
    if begun.is_file() and begun.read_text(encoding="utf-8") != one.recipe:
        raise ContractError(f"{name} was begun by another recipe: remove {folder}")
    if ending is None:
        tell(f"{name}: training for {settings.cpu_minutes:g} CPU-minutes")
        ending = _train(one, settings)
    elif ending["cpu_minutes"] != settings.cpu_minutes:
        raise ContractError(
            f"{name} was trained for {ending['cpu_minutes']:g} CPU-minutes, not "
            f"{settings.cpu_minutes:g}: say so, or remove {folder}"
        )
    tell(
        f"{name}: {ending['steps']} steps, {ending['cpu_s']:.0f} CPU-s, "
        f"{ending['valid_db']:.2f} dB on fixed samples"
    )
    return ending


def finished(folder: Path) -> dict[str, Any] | None:
    """Return how a training ended; None where it did not."""
    path = folder / DONE_FILE
    if not path.is_file():
        return None
    ending: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return ending


def checkpoint_of(runs: Path, run: Run) -> Path:
    """Return the file that a training wrote, or will write."""
    folder = runs / run.training
    options = TrainOptions(out_dir=folder, size=run.row.size, role=run.row.role or None)
    return checkpoint_path(read_recipe(folder / RECIPE), options, None)


def _train(one: Trainee, settings: EqualTime) -> dict[str, Any]:
    folder, row = settings.out_dir / one.run.training, one.run.row
    folder.mkdir(parents=True, exist_ok=True)
    recipe = folder / RECIPE
    with atomic_output(recipe) as part:
        part.write_text(one.recipe, encoding="utf-8")
    options = TrainOptions(
        out_dir=folder,
        size=row.size,
        role=row.role or None,
        data_folder=settings.pictures,
        valid_folder=one.valid,
        steps=settings.steps,
        max_cpu_minutes=settings.cpu_minutes,
        resume=checkpoint_of(settings.out_dir, one.run).exists(),
        workers=settings.workers,
        vgg=one.vgg,
        sharp_folder=one.sharp,
        validate_s=AT_THE_END_S,
    )
    result = train(recipe, options, material=one.material())
    ending = {
        "cpu_minutes": settings.cpu_minutes,
        "cpu_s": round(result.cpu_s, 1),
        "steps": result.steps,
        "valid_db": round(result.valid_db, 3),
    }
    with atomic_output(folder / DONE_FILE) as part:
        part.write_text(json.dumps(ending) + "\n", encoding="utf-8")
    for samples in folder.glob(SAMPLES):
        shutil.rmtree(samples)
    return ending
