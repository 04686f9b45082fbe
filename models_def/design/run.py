"""One design run on disk: checkpoint, log, the lens; resume; several machines by torchrun."""

import json
import math
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.loop import DesignLoop, Progress
from camkit.models_def.design.recipe import DesignRecipe, recipe_digest
from camkit.models_def.design.starts import Starts
from camkit.models_def.optics.lens_file.lens_file import write_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.finish import finished
from camkit.models_def.optics.search.problem import valid_share
from camkit.models_def.training.checkpoint import read_table

FORMAT: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignOptions:
    """The files and the options of a design.

    Attributes:
        out_dir: Checkpoint, log and lens.
        recipe_folder: For relative paths in the recipe.
        pictures: Sharp pictures; None for procedural scenes alone.
        threads: Of torch.
        resume: Go on from the checkpoint.
        overwrite: Start anew over an earlier run.
    """

    out_dir: Path
    recipe_folder: Path | None = None
    pictures: Path | None = None
    threads: int = 1
    resume: bool = False
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignView:
    """The parts of a design that can be looked at.

    Attributes:
        lens: The present lens.
        kernels: (depth, field, 3, k, k).
        patches: Fixed patches in sRGB tone: (row, 3, h, w) captures, recovered, sharp.
    """

    lens: Lens
    kernels: Tensor
    patches: tuple[Tensor, Tensor, Tensor]


class DesignRun:
    """A design with its files."""

    def __init__(self, recipe: DesignRecipe, options: DesignOptions) -> None:
        """Prepare the run; nothing is written before the first validated moment.

        Raises:
            ContractError: If there is an earlier run and neither resume nor overwrite is asked
                for, or its checkpoint belongs to another recipe.
        """
        torch.set_num_threads(options.threads)
        _join_workers()
        self.recipe, self.options = recipe, options
        self.checkpoint = options.out_dir / f"{recipe.name}.pt"
        self.log = options.out_dir / f"{recipe.name}.jsonl"
        self.lens_file = options.out_dir / f"{recipe.name}.toml"
        if self.checkpoint.exists() and not (options.resume or options.overwrite):
            raise ContractError(
                f"{self.checkpoint} is there already: give {option_text('resume')} to go on or "
                f"{option_text('overwrite')}"
            )
        begin, cpu = time.monotonic(), time.process_time()
        # with a window of its own a checkpoint holds all that a search would find again
        held = options.resume and self.checkpoint.exists() and recipe.pixels.kernel_px > 0
        given = replace(recipe, starts=Starts()) if held else recipe
        parts = parts_of(given, folder=options.recipe_folder, pictures=options.pictures)
        _share_lens(parts.lens)
        self.loop = DesignLoop(parts, recipe.schedule)
        searched = bool(given.starts.count and recipe.schedule.lens_rate)
        self.searched_s = time.monotonic() - begin if searched else 0.0
        self._spent_s = self.searched_s
        self._spent_cpu_s = time.process_time() - cpu if searched else 0.0
        if options.resume:
            self._load()
        elif self.leads:
            self.log.unlink(missing_ok=True)

    @property
    def leads(self) -> bool:
        """Return whether this process writes the files."""
        return not torch.distributed.is_initialized() or torch.distributed.get_rank() == 0

    def go(self, until: int | None = None) -> Iterator[Progress]:
        """Run, yielding every validated moment after it is on disk."""
        begin, cpu = time.monotonic(), time.process_time()
        before_s, before_cpu_s = self._spent_s, self._spent_cpu_s
        if self.loop.step == 0:
            self._record(self.loop.judge())
        for moment in self.loop.run(until):
            self._spent_s = before_s + time.monotonic() - begin
            self._spent_cpu_s = before_cpu_s + time.process_time() - cpu
            timed = replace(moment, seconds=self._spent_s)
            self._record(timed)
            yield timed

    def _record(self, moment: Progress) -> None:
        if not self.leads:
            return
        lens = self.loop.parts.lens
        self.options.out_dir.mkdir(parents=True, exist_ok=True)
        table = {
            "format": FORMAT,
            "digest": recipe_digest(self.recipe),
            "spent_s": self._spent_s,
            "spent_cpu_s": self._spent_cpu_s,
            "lens": lens.state_dict(),
            **self.loop.state(),
        }
        part = self.checkpoint.with_name(self.checkpoint.name + ".part")
        torch.save(table, part)
        part.replace(self.checkpoint)
        entry = {
            "step": moment.step,
            "seconds": round(self._spent_s, 3),
            "cpu_s": round(self._spent_cpu_s, 3),
            "loss": moment.loss if math.isfinite(moment.loss) else None,
            "valid_db": moment.valid_db,
            "best_db": moment.best_db,
            "lost_light": moment.lost_light,
            "valid_rays": float(valid_share(lens.problem, lens.scaled().detach()[None])),
        }
        with self.log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")

    def _load(self) -> None:
        if not self.checkpoint.exists():
            return
        table = read_table(self.checkpoint)
        if table["format"] != FORMAT or "digest" not in table:
            raise ContractError(f"{self.checkpoint} is no design checkpoint of format {FORMAT}")
        if table["digest"] != recipe_digest(self.recipe):
            raise ContractError(
                f"{self.checkpoint} belongs to another recipe, or to other {option_text('steps')}, "
                f"{option_text('lens_rate')} and the like; repeat the same options, or give "
                f"{option_text('overwrite')} or {option_text('out_dir')}"
            )
        self._spent_s, self._spent_cpu_s = table["spent_s"], table["spent_cpu_s"]
        self.loop.parts.lens.load_state_dict(table["lens"])
        self.loop.load(table)

    def finish(self) -> dict[str, Any]:
        """Restore the best lens, write it, and return a report on the run."""
        self.loop.take_best()
        lens = self.loop.parts.lens
        found = finished(lens.problem, lens.scaled().detach())
        note = f"camkit design, recipe {self.recipe.name}, from {found.name}"
        write_lens(replace(found, name=self.recipe.name, note=note), self.lens_file)
        entries = [json.loads(line) for line in self.log.read_text("utf-8").splitlines()]
        return {
            "name": self.recipe.name,
            "steps": self.loop.step,
            "begin_db": entries[0]["valid_db"],
            "best_db": self.loop.best_db,
            "seconds": round(self._spent_s, 1),
            "cpu_s": round(self._spent_cpu_s, 1),
            "lens": str(self.lens_file),
            "checkpoint": str(self.checkpoint),
            "log": str(self.log),
        }

    def view(self) -> DesignView:
        """Return the present lens, its kernels and a few fixed patches behind it."""
        kernels, patches = self.loop.look()
        return DesignView(lens=self.loop.parts.lens.lens(), kernels=kernels, patches=patches)


def _join_workers() -> None:
    """Join the process group that torchrun describes; without one there is a single process."""
    if int(os.environ.get("WORLD_SIZE", "1")) > 1 and not torch.distributed.is_initialized():
        torch.distributed.init_process_group("nccl" if torch.cuda.is_available() else "gloo")


def _share_lens(lens: nn.Module) -> None:
    """Copy the lens of the first process to all: another machine may find another start."""
    if torch.distributed.is_initialized():
        for value in lens.state_dict().values():
            torch.distributed.broadcast(value, 0)
