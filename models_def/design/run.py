"""One design run on disk: checkpoint, log, the lens; resume; several machines by torchrun."""

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.design_recipe import DesignRecipe, recipe_digest
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.design.loop import DesignLoop, DesignParts, Progress, Watch
from camkit.models_def.design.run_files import RunFiles, RunOptions
from camkit.models_def.design.starts import Starts
from camkit.models_def.optics.lens_file.lens_file import write_lens
from camkit.models_def.optics.lens_file.states import plain_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.problem import valid_share
from camkit.models_def.training.log import read_log

FORMAT: Final = 2
_LEAST_RAYS: Final = 0.5
_MOST_LOST: Final = 0.99


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignOptions(RunOptions):
    """The files and the options of a design.

    Attributes:
        out_dir: Checkpoint, log and lens.
        pictures: Sharp pictures; None for procedural scenes alone.
    """

    out_dir: Path
    pictures: Path | None = None


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
        self.recipe, self.options = recipe, options
        stem = options.out_dir / recipe.name
        self.files = RunFiles(stem, options, FORMAT)
        self.lens_file = stem.with_name(f"{recipe.name}.toml")
        _join_workers()
        # with a window of its own a checkpoint holds all that a search would find again
        holds_lens = self.files.resumes and recipe.pixels.kernel_px > 0
        begin_recipe = replace(recipe, starts=Starts(), descent=None) if holds_lens else recipe
        start = ""
        if holds_lens and recipe.starts.library:
            table = self.files.read(recipe_digest(recipe), "steps", "lens_rate", "library")
            start = table["start"]

        def parts_at(start: str, at: DesignRecipe = begin_recipe) -> DesignParts:
            return parts_of(
                at, folder=options.recipe_folder, pictures=options.pictures, start=start
            )

        parts = parts_at(start)
        leader = _shared_start(parts.start)
        if leader != parts.start:
            parts = parts_at(leader, replace(recipe, starts=Starts(), descent=None))
        _share_lens(parts.lens)
        self.loop = DesignLoop(parts, recipe.schedule)
        looked = begin_recipe.starts.searches or begin_recipe.descent
        searched = bool(looked and recipe.schedule.lens_rate)
        self.searched_s = self.files.stop() if searched else 0.0
        if self.files.resumes:
            table = self.files.read(recipe_digest(recipe), "steps", "lens_rate", "library")
            # a design from before there were waves goes on by rays
            by_rays = {"sharp": torch.zeros_like(parts.lens.state_dict()["sharp"])}
            parts.lens.load_state_dict(by_rays | table["lens"])
            self.loop.load(table)

    @property
    def leads(self) -> bool:
        """Return whether this process writes the files."""
        return not torch.distributed.is_initialized() or torch.distributed.get_rank() == 0

    def go(self, last_step: int | None = None, on_step: Watch | None = None) -> Iterator[Progress]:
        """Run, yielding every validated moment, the beginning included, after it is on disk.

        Args:
            last_step: To run up to; the last by default.
            on_step: Is called with the number of finished steps after each one.

        Raises:
            ContractError: If most rays of the lens at the start are lost, or all light of a field.
        """
        self.files.start()
        if self.loop.step == 0:
            first = self.loop.judge()
            self._refuse_lost(first)
            first = replace(first, seconds=self.files.stop())
            self._record(first)
            yield first
        for moment in self.loop.run(last_step, on_step):
            timed = replace(moment, seconds=self.files.stop())
            self._record(timed)
            yield timed

    def _refuse_lost(self, first: Progress) -> None:
        """Refuse a start whose gradients say nothing: a unit of the recipe is likely wrong."""
        lens, optics = self.loop.parts.lens, self.recipe.optics
        ray_share = _valid_rays(lens)
        if ray_share < _LEAST_RAYS:
            raise ContractError(
                f"{ray_share:.0%} of the rays reach the sensor at the start. Check the bounds of "
                f"[[vary]] (a curvature is 1 / radius, in 1/mm), optics.half_field_deg = "
                f"{optics.half_field_deg:g} degrees, efl_mm = {optics.efl_mm:g} and f_number = "
                f"{optics.f_number:g}, or begin at another lens"
            )
        if first.lost_light > _MOST_LOST:
            pixels = lens.pixels
            width_um = pixels.kernel_px * pixels.pitch_um
            raise ContractError(
                f"{first.lost_light:.0%} of the light of the worst field falls beyond the window "
                f"of the PSF at the start: {pixels.kernel_px} px (pixels.kernel_px) of "
                f"{pixels.pitch_um:g} um (pixels.pitch_um) are {width_um:.3g} um. Check pitch_um, "
                f"the bounds of [[vary]] and optics.half_field_deg = {optics.half_field_deg:g} "
                "degrees, begin at a sharper lens, or take a larger kernel_px"
            )

    def _record(self, moment: Progress) -> None:
        if not self.leads:
            return
        lens = self.loop.parts.lens
        entry = {
            "step": moment.step,
            "loss": moment.loss if math.isfinite(moment.loss) else None,
            "valid_db": moment.valid_db,
            "best_db": moment.best_db,
            "merit": moment.merit,
            "lost_light": moment.lost_light,
            "valid_rays": _valid_rays(lens),
        }
        state = {"lens": lens.state_dict(), "start": self.loop.parts.start, **self.loop.state()}
        self.files.record(recipe_digest(self.recipe), state, entry)

    def finish(self) -> dict[str, Any]:
        """Restore the best lens, write it, and return a report on the run."""
        begin = read_log(self.files.log)[0]
        self.loop.take_best()
        lens = self.loop.parts.lens
        best_lens = lens.finished()
        note = f"camkit design, recipe {self.recipe.name}, from {best_lens.name}"
        write_lens(replace(best_lens, name=self.recipe.name, note=note), self.lens_file)
        return {
            "name": self.recipe.name,
            "start": self.loop.parts.start or self.recipe.prescription,
            "steps": self.loop.step,
            "psf_model": "waves" if bool(lens.state_dict()["sharp"].any()) else "rays",
            "begin_db": begin["valid_db"],
            "best_db": self.loop.best_db,
            "best_step": self.loop.best_step,
            "begin_merit": begin.get("merit"),
            "best_merit": self.loop.best_merit,
            "is_psnr": self.recipe.loss.is_psnr,
            "seconds": round(self.files.spent_s, 1),
            "cpu_s": round(self.files.spent_cpu_s, 1),
            "lens": str(self.lens_file),
            "checkpoint": str(self.files.checkpoint),
            "log": str(self.files.log),
        }

    def view(self) -> DesignView:
        """Return the present lens, its kernels and a few fixed patches behind it."""
        kernels, patches = self.loop.look()
        lens = plain_lens(self.loop.parts.lens.lens())
        return DesignView(lens=lens, kernels=kernels, patches=patches)


def _valid_rays(lens: DesignLens) -> float:
    """Return the share of rays that reach the sensor, over fields, colours, depths and states."""
    shares = [valid_share(problem, scaled.detach()[None]) for problem, scaled in lens.views()]
    return float(torch.stack(shares).mean())


def _join_workers() -> None:
    """Join the process group that torchrun describes; without one there is a single process."""
    if int(os.environ.get("WORLD_SIZE", "1")) > 1 and not torch.distributed.is_initialized():
        torch.distributed.init_process_group("nccl" if torch.cuda.is_available() else "gloo")


def _shared_start(name: str) -> str:
    """Return the name of the start of the first process."""
    if not torch.distributed.is_initialized():
        return name
    names = [name]
    torch.distributed.broadcast_object_list(names, 0)
    return names[0]


def _share_lens(lens: nn.Module) -> None:
    """Copy the lens of the first process to all: another machine may find another start."""
    if torch.distributed.is_initialized():
        for value in lens.state_dict().values():
            torch.distributed.broadcast(value, 0)
