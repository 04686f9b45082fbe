"""The networks of the tables, each trained for the same CPU time by the shipped recipe.

A row changes the recipe's sampling and seed, nothing else.
"""

import re
from argparse import Namespace
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Final, cast

import numpy as np

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf
from camkit.models_def.kinds.spad.samples import draw_luminance
from camkit.models_def.kinds.spad.sampling import Mode, make_sampling
from camkit.models_def.kinds.spad.theory import Covariance, best_gaussian, covariance_of
from camkit.models_def.kinds.spad.training import SpadMaterial
from camkit.models_def.training.pictures import open_source
from tools.tables.equal_training import Trainee
from tools.tables.recipe_text import with_keys
from tools.tables.table_rows import Run

RECIPES: Final = Path(str(resources.files("camkit.models_def.recipes")))
RECIPE: Final = "spad_sr.toml"
ROLE: Final = "upscale"
SAMPLING_TABLE: Final = re.compile(r"^\[sampling\]\n(?:[^\[\n].*\n|\n)*", re.MULTILINE)
PLATE_FILE: Final = re.compile(r'^psf = "(.*)"$', re.MULTILINE)
STEPS: Final = 1_000_000
"""More than any network makes in its time, so that time ends every schedule."""
LEVEL: Final = 1e4
"""Photons of white at which the plate was trained."""
CROPS: Final = 200
CROP_PX: Final = 256
CROP_SEED: Final = 7


def trainee(run: Run, options: Namespace) -> Trainee:
    """Return the network of a row, which is validated on pictures to choose by."""
    return Trainee(
        run=run,
        recipe=recipe_text(run, options.data),
        material=lambda: _material(run.row.optics, options.data),
        valid=options.valid,
    )


def recipe_text(run: Run, pictures: Path | None) -> str:
    """Return the shipped recipe with the sampling and seed of a row.

    Raises:
        ContractError: If the recipe has not one sampling and one schedule.
    """
    table = _sampling_table(run.row.optics, pictures)
    text, samplings = SAMPLING_TABLE.subn(table, _shipped())
    if samplings != 1:
        raise ContractError(f"{RECIPE} must have one [sampling]")
    return with_keys(text, "schedule", {"seed": run.seed})


def _sampling_table(sampling: str, pictures: Path | None) -> str:
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
    match = PLATE_FILE.search(_shipped())
    if match is None:
        raise ContractError(f'{RECIPE} must have a line psf = "..."')
    return (RECIPES / match[1]).resolve()


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


def _material(sampling: str, pictures: Path | None) -> SpadMaterial:
    kernel = read_plate_psf(plate_file()) if sampling == "learned" else None
    sigma = level_sigma(pictures) if sampling == "gaussian" else None
    return SpadMaterial(
        kernel=make_sampling(cast("Mode", sampling), kernel=kernel, sigma=sigma).kernel
    )
