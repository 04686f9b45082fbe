"""One design of a plate on disk: checkpoint, log, the plate; resume."""

import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import torch

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.design.plate.loop import Moment, PlateLoop
from camkit.models_def.design.plate.maps import begin_map
from camkit.models_def.design.plate.reader import PlateReader, open_reader, reader_digest
from camkit.models_def.design.plate.recipe import PlateRecipe, plate_recipe_digest
from camkit.models_def.optics.diffraction.heights import FullMap
from camkit.models_def.optics.diffraction.map_numbers import numbers_of
from camkit.models_def.optics.diffraction.plate import Plate, write_plate
from camkit.models_def.training.checkpoint import read_table

FORMAT: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateRunOptions:
    """The files and the options of a design.

    Attributes:
        out: The plate (.toml); its heights, checkpoint (.pt) and log (.jsonl) lie beside it.
        recipe_folder: For relative paths in the recipe.
        seconds: Of this run, at most.
        threads: Of torch.
        resume: Go on from the checkpoint.
        overwrite: Start anew over an earlier run.
    """

    out: Path
    recipe_folder: Path | None = None
    seconds: float = math.inf
    threads: int = 1
    resume: bool = False
    overwrite: bool = False


class PlateRun:
    """A design with its files."""

    def __init__(self, recipe: PlateRecipe, options: PlateRunOptions) -> None:
        """Prepare the run; nothing is written before the first logged moment.

        Raises:
            ContractError: If there is an earlier run and neither resume nor overwrite is asked
                for, its checkpoint belongs to another recipe, or the recipe cannot begin.
        """
        if options.out.suffix.lower() != ".toml":
            raise ContractError(f"a plate is written as .toml; got {options.out.name}")
        self.recipe, self.options = recipe, options
        self.checkpoint = options.out.with_suffix(".pt")
        self.log = options.out.with_suffix(".jsonl")
        if not (options.resume or options.overwrite):
            there = [path for path in (self.checkpoint, options.out) if path.exists()]
            if there:
                raise ContractError(
                    f"{there[0]} is there already: give {option_text('resume')} to go on or "
                    f"{option_text('overwrite')}"
                )
        torch.set_num_threads(options.threads)
        self.digest = plate_recipe_digest(recipe)
        made = begin_map(recipe, options.recipe_folder)
        self.loop = PlateLoop(recipe, made, self._reader())
        self._spent_s = self._spent_cpu_s = 0.0
        if options.resume:
            self._load()

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
        begin, cpu = time.monotonic(), time.process_time()
        before_s, before_cpu_s = self._spent_s, self._spent_cpu_s
        self.options.out.parent.mkdir(parents=True, exist_ok=True)
        if self.loop.step == 0:
            self.log.unlink(missing_ok=True)
            first = self.loop.judge()
            self._record(first)
            yield first
        left_s = max(0.0, self.options.seconds - (time.monotonic() - begin))
        for moment in self.loop.run(seconds=left_s):
            self._spent_s = before_s + time.monotonic() - begin
            self._spent_cpu_s = before_cpu_s + time.process_time() - cpu
            timed = replace(moment, seconds=self._spent_s)
            self._record(timed)
            yield timed

    def _record(self, moment: Moment) -> None:
        table = {
            "format": FORMAT,
            "digest": self.digest,
            "spent_s": self._spent_s,
            "spent_cpu_s": self._spent_cpu_s,
            **self.loop.state(),
        }
        part = self.checkpoint.with_name(self.checkpoint.name + ".part")
        torch.save(table, part)
        part.replace(self.checkpoint)
        entry: dict[str, Any] = {
            "step": moment.step,
            "seconds": round(self._spent_s, 3),
            "cpu_s": round(self._spent_cpu_s, 3),
            "loss": moment.loss,
            "best_loss": moment.best_loss,
            "core_share": [round(share, 5) for share in moment.reached.core_share],
            "streak_share": [round(share, 5) for share in moment.reached.streak_share],
            "far_share": [round(share, 5) for share in moment.reached.far_share],
        }
        entry |= _told(moment)
        with self.log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")

    def _load(self) -> None:
        if not self.checkpoint.exists():
            return
        table = read_table(self.checkpoint)
        if table.get("format") != FORMAT or "digest" not in table:
            raise ContractError(f"{self.checkpoint} is no checkpoint of a plate's design")
        if table["digest"] != self.digest:
            raise ContractError(
                f"{self.checkpoint} belongs to another recipe, or to other {option_text('steps')} "
                f"or {option_text('seed')}; repeat the same options, or add "
                f"{option_text('overwrite')} or another -o"
            )
        self._spent_s, self._spent_cpu_s = table["spent_s"], table["spent_cpu_s"]
        self.loop.load(table)

    def finish(self) -> dict[str, Any]:
        """Restore the best map, write the plate, and return a report on the run."""
        self.loop.take_best()
        made = self.loop.made
        with torch.no_grad():
            height_um = made().detach()
        recipe = self.recipe
        write_plate(
            Plate(
                name=recipe.name,
                note=f"camkit plate design, recipe {recipe.name}, {self.loop.step} steps",
                glass=recipe.glass,
                bench=recipe.bench,
                height_um=height_um,
                etching=recipe.etching,
                numbers=None if isinstance(made, FullMap) else numbers_of(made),
            ),
            self.options.out,
        )
        judged = self.loop.judge()
        last = judged.reached
        entries = [json.loads(line) for line in self.log.read_text("utf-8").splitlines()]
        return {
            "name": recipe.name,
            "steps": self.loop.step,
            "of_steps": recipe.schedule.steps,
            "begin_loss": entries[0]["loss"],
            "best_loss": self.loop.best_loss,
            "wavelengths_um": list(recipe.pixels.wavelengths_um),
            "core_share": [round(share, 5) for share in last.core_share],
            "streak_share": [round(share, 5) for share in last.streak_share],
            "far_share": [round(share, 5) for share in last.far_share],
            "seconds": round(self._spent_s, 1),
            "cpu_s": round(self._spent_cpu_s, 1),
            "plate": str(self.options.out),
            "checkpoint": str(self.checkpoint),
            "log": str(self.log),
            **{f"begin_{key}": entries[0][key] for key in _told(judged)},
            **_told(judged),
        }


def _told(moment: Moment) -> dict[str, float]:
    """Return the reader's results on fixed patches; nothing without one."""
    if moment.picture is None:
        return {}
    found = moment.picture
    return {
        "picture_loss": round(found.loss, 6),
        "picture_db": round(found.db, 3),
        "picture_capture_db": round(found.capture_db, 3),
    }
