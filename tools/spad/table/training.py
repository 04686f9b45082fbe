"""The networks of the tables, each trained for the same CPU time by the shipped recipe.

A row changes the recipe's sampling and seed, nothing else.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf
from camkit.models_def.kinds.spad.samples import draw_luminance
from camkit.models_def.kinds.spad.sampling import make_sampling
from camkit.models_def.kinds.spad.theory import Covariance, best_gaussian, covariance_of
from camkit.models_def.kinds.spad.training import SpadMaterial
from camkit.models_def.training.pictures import open_source
from tools.comparison.equal_training import (
    EqualTime,
    Tell,
    Trainee,
    checkpoint_in,
    finished,
    trained,
)
from tools.spad.table.rows import Row, Sampled

RECIPES: Final = Path(str(resources.files("camkit.models_def.recipes")))
RECIPE: Final = "spad_sr.toml"
ROLE: Final = "upscale"
SAMPLING_TABLE: Final = re.compile(r"^\[sampling\]\n(?:[^\[\n].*\n|\n)*", re.MULTILINE)
SCHEDULE_LINE: Final = "[schedule]\n"
PLATE_FILE: Final = re.compile(r'^psf = "(.*)"$', re.MULTILINE)
STEPS: Final = 1_000_000
"""More than any network makes in its time, so that time ends every schedule."""
LEVEL: Final = 1e4
"""Photons of white at which the plate was trained."""
CROPS: Final = 200
CROP_PX: Final = 256
CROP_SEED: Final = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class Pictures:
    """Where pictures lie.

    Attributes:
        train: To train on; None for procedural scenes alone.
        valid: To choose by.
    """

    train: Path | None
    valid: Path | None


def train_runs(
    runs: Iterable[tuple[Row, int]],
    out_dir: Path,
    pictures: Pictures,
    cpu_minutes: float,
    tell: Tell,
) -> None:
    """Train whatever is not trained yet.

    Raises:
        ContractError: If something was trained for another time.
    """
    time = EqualTime(out_dir=out_dir, pictures=pictures.train, cpu_minutes=cpu_minutes, steps=STEPS)
    for row, seed in runs:
        trained(_trainee(row, seed, pictures), time, tell)


def ended(out_dir: Path, row: Row, seed: int) -> dict[str, Any] | None:
    """Return how a training ended; None where it did not."""
    return finished(out_dir / row.run(seed))


def checkpoint_of(out_dir: Path, row: Row, seed: int) -> Path:
    """Return the file that a training wrote."""
    return checkpoint_in(out_dir / row.run(seed), row.size, ROLE)


def recipe_text(row: Row, seed: int, pictures: Path | None) -> str:
    """Return the shipped recipe with the sampling and seed of a row.

    Raises:
        ContractError: If the recipe does not say both where it is expected.
    """
    shipped = _shipped()
    if len(SAMPLING_TABLE.findall(shipped)) != 1 or shipped.count(SCHEDULE_LINE) != 1:
        raise ContractError(f"{RECIPE} must have one [sampling] and one [schedule]")
    text = SAMPLING_TABLE.sub(_sampling_table(row.sampling, pictures), shipped)
    return text.replace(SCHEDULE_LINE, f"{SCHEDULE_LINE}seed = {seed}\n")


def _sampling_table(sampling: Sampled, pictures: Path | None) -> str:
    lines = ["[sampling]", f'mode = "{sampling}"']
    if sampling == "learned":
        lines.append(f'psf = "{plate_file()}"')
    if sampling == "gaussian":
        lines.append(f"sigma = {level_sigma(pictures)!r}")
    return "\n".join(lines) + "\n\n"


def plate_file() -> Path:
    """Return the file of the shipped plate's kernel.

    Raises:
        ContractError: If the recipe names none.
    """
    found = PLATE_FILE.search(_shipped())
    if found is None:
        raise ContractError(f'{RECIPE} must have a line psf = "..."')
    return (RECIPES / found[1]).resolve()


@lru_cache
def natural_covariance(pictures: Path | None) -> Covariance:
    """Measure the covariance of the pictures that are trained on, by some crops."""
    source = open_source(pictures, picture_share=1.0, scenes=CROPS, scene_px=2 * CROP_PX)
    rng = np.random.default_rng(CROP_SEED)
    return covariance_of(draw_luminance(source, rng, CROP_PX)[0, 0].numpy() for _ in range(CROPS))


@lru_cache
def level_sigma(pictures: Path | None) -> float:
    """Return the sigma of the best Gaussian at the plate's level of light, in sub-pixels."""
    return round(best_gaussian(natural_covariance(pictures), LEVEL), 4)


def _shipped() -> str:
    return (RECIPES / RECIPE).read_text(encoding="utf-8")


def _material(sampling: Sampled, pictures: Path | None) -> SpadMaterial:
    kernel = read_plate_psf(plate_file()) if sampling == "learned" else None
    sigma = level_sigma(pictures) if sampling == "gaussian" else None
    return SpadMaterial(kernel=make_sampling(sampling, kernel=kernel, sigma=sigma).kernel)


def _trainee(row: Row, seed: int, pictures: Pictures) -> Trainee:
    return Trainee(
        name=row.run(seed),
        recipe=recipe_text(row, seed, pictures.train),
        size=row.size,
        role=ROLE,
        material=lambda: _material(row.sampling, pictures.train),
        valid=pictures.valid,
    )
