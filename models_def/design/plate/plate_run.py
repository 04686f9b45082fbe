"""One design of a plate on disk: checkpoint, log, the plate; resume."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import torch

from camkit.errors import ContractError
from camkit.models_def.design.plate.goal import GoalShares
from camkit.models_def.design.plate.maps import begin_map
from camkit.models_def.design.plate.plate_loop import Moment, PlateLoop
from camkit.models_def.design.plate.plate_recipe import PlateRecipe, plate_recipe_digest
from camkit.models_def.design.plate.reader import PlateReader, open_reader, reader_digest
from camkit.models_def.design.run_files import RunFiles, RunOptions
from camkit.models_def.optics.diffraction.heights import FullMap
from camkit.models_def.optics.diffraction.map_numbers import numbers_of
from camkit.models_def.optics.diffraction.plate import Plate, write_plate
from camkit.models_def.training.log import read_log

FORMAT: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateRunOptions(RunOptions):
    """The files and the options of a design.

    Attributes:
        out: The plate (.toml); its heights, checkpoint (.pt) and log (.jsonl) lie beside it.
        seconds: Of this run, at most.
    """

    out: Path
    seconds: float = math.inf


class PlateRun:
    """A design with its files."""

    def __init__(self, recipe: PlateRecipe, options: PlateRunOptions) -> None:
        """Prepare the run; nothing is written before the first logged moment.

        Raises:
            ContractError: If there is an earlier run that is neither resumed nor overwritten, its
                checkpoint belongs to another recipe, or the recipe cannot begin.
        """
        if options.out.suffix.lower() != ".toml":
            raise ContractError(f"a plate is written as .toml; got {options.out.name}")
        self.recipe, self.options = recipe, options
        self.files = RunFiles(options.out.with_suffix(""), options, FORMAT, options.out)
        self.digest = plate_recipe_digest(recipe)
        height_map = begin_map(recipe, options.recipe_folder)
        self.loop = PlateLoop(recipe, height_map, self._reader())
        if self.files.resumes:
            self.loop.load(self.files.read(self.digest, "steps", "seed"))

    def _reader(self) -> PlateReader | None:
        recipe, folder = self.recipe, self.options.recipe_folder
        if recipe.reader is None:
            return None
        self.digest += reader_digest(recipe.reader, folder)
        return open_reader(
            recipe.reader,
            psf_px=recipe.pixels.side_px,
            colours=len(recipe.pixels.wavelengths_um),
            seed=recipe.schedule.seed,
            folder=folder,
        )

    def go(self) -> Iterator[Moment]:
        """Run, yielding every logged moment, the beginning included, after it is on disk."""
        self.files.start()
        before_s = self.files.spent_s
        if self.loop.step == 0:
            first = self.loop.judge()
            self._record(first)
            yield first
        left_s = max(0.0, self.options.seconds - (self.files.stop() - before_s))
        for moment in self.loop.run(seconds=left_s):
            timed = replace(moment, seconds=self.files.stop())
            self._record(timed)
            yield timed

    def _record(self, moment: Moment) -> None:
        entry = {
            "step": moment.step,
            "loss": moment.loss,
            "best_loss": moment.best_loss,
            **_shares(moment.shares),
            **_reader_results(moment),
        }
        self.files.record(self.digest, self.loop.state(), entry)

    def finish(self) -> dict[str, Any]:
        """Restore the best map, write the plate, and return a report on the run."""
        self.loop.take_best()
        height_map = self.loop.height_map
        with torch.no_grad():
            height_um = height_map().detach()
        recipe = self.recipe
        write_plate(
            Plate(
                name=recipe.name,
                note=f"camkit plate design, recipe {recipe.name}, {self.loop.step} steps",
                glass=recipe.glass,
                bench=recipe.bench,
                height_um=height_um,
                etching=recipe.etching,
                numbers=None if isinstance(height_map, FullMap) else numbers_of(height_map),
            ),
            self.options.out,
        )
        judged = self.loop.judge()
        first = read_log(self.files.log)[0]
        return {
            "name": recipe.name,
            "steps": self.loop.step,
            "of_steps": recipe.schedule.steps,
            "begin_loss": first["loss"],
            "best_loss": self.loop.best_loss,
            "wavelengths_um": list(recipe.pixels.wavelengths_um),
            **_shares(judged.shares),
            "seconds": round(self.files.spent_s, 1),
            "cpu_s": round(self.files.spent_cpu_s, 1),
            "plate": str(self.options.out),
            "checkpoint": str(self.files.checkpoint),
            "log": str(self.files.log),
            **{f"begin_{key}": first[key] for key in _reader_results(judged)},
            **_reader_results(judged),
        }


def _shares(goal_shares: GoalShares) -> dict[str, list[float]]:
    """Return what the colours have of the goal, rounded."""
    shares = (goal_shares.core_share, goal_shares.streak_share, goal_shares.far_share)
    names = ("core_share", "streak_share", "far_share")
    return {n: [round(v, 5) for v in s] for n, s in zip(names, shares, strict=True)}


def _reader_results(moment: Moment) -> dict[str, float]:
    """Return the reader's results on fixed patches; nothing without one."""
    if moment.picture is None:
        return {}
    picture = moment.picture
    return {
        "picture_loss": round(picture.loss, 6),
        "picture_db": round(picture.db, 3),
        "picture_capture_db": round(picture.capture_db, 3),
    }
