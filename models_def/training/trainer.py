"""The trainer: fits one network of a recipe, resumes exactly, ends in time.

pool of samples -> patches of a step -> network -> loss in the square-root domain -> AdamW
                                                        -> average of the weights -> validation
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

import torch

from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.networks.catalog import check_patch
from camkit.models_def.time_limit import limited
from camkit.models_def.training.checkpoint import (
    Checkpoint,
    State,
    read_checkpoint,
    write_checkpoint,
)
from camkit.models_def.training.credits import describe_data
from camkit.models_def.training.first_weights import (
    FirstWeights,
    read_first_weights,
    take_first_weights,
)
from camkit.models_def.training.fitter import Fitter, patch_objective
from camkit.models_def.training.fitting import FitRequest, OwnFitting, own_fitting
from camkit.models_def.training.kind import (
    Judge,
    Material,
    Score,
    build_role,
    read_recipe,
    training_kind,
)
from camkit.models_def.training.log import RunLog
from camkit.models_def.training.pool import SamplePool, open_pool
from camkit.models_def.training.recipe import Recipe
from camkit.models_def.training.refinement import Refinement
from camkit.models_def.training.schedule import (
    NO_STEP,
    TrainOptions,
    TrainResult,
    progress_of,
    short_time_text,
)
from camkit.progress import Task, duration, left_text, note, working
from camkit.stopwatch import Stopwatch

__all__ = ["TrainOptions", "TrainResult", "checkpoint_path", "train"]

LOG_STEPS: Final = 50
Returned = TypeVar("Returned")


def train(
    recipe_path: Path,
    options: TrainOptions,
    *,
    material: Material | None = None,
    refinement: Refinement | None = None,
    stopwatch: Stopwatch | None = None,
) -> TrainResult:
    """Train one network of a recipe.

    Args:
        recipe_path: TOML recipe.
        options: Where, how long and with what.
        material: What samples are made with; None has the kind prepare it (kernels of a lens take
            minutes, and are kept in `out_dir`).
        refinement: Later training; None fits a new network to the recipe's loss.
        stopwatch: What budgets of time count by; None begins now.

    Raises:
        ContractError: If recipe, options or the checkpoint to resume do not fit, or a limit of
            time ends before the kernels are prepared.
        UnsupportedError: If cameras of this kind cannot be trained.
    """
    stopwatch = stopwatch or Stopwatch()
    torch.set_num_threads(options.threads)
    recipe = read_recipe(recipe_path)
    kind, role = training_kind(recipe.kind), recipe.role(options.role)
    entry = recipe.network(options.size, role)
    schedule = entry.schedule if refinement is None else refinement.schedule
    # before anything is traced
    network, layout = build_role(kind, recipe, role, options.size)
    check_patch(entry.network, network, schedule.patch_px)
    layout.check(entry.network, network)
    first = None if refinement is None else refinement.first
    if options.start is not None:
        if refinement is not None:
            raise ContractError("a refinement has its own start; leave start away")
        first = read_first_weights(options.start, options.size, role)
    if first is not None:
        take_first_weights(network, first)
    fitting = None
    if refinement is None:
        request = FitRequest(
            recipe=recipe,
            role=role,
            entry=entry,
            device=options.device,
            first=first,
            vgg=options.vgg,
            sharp=options.sharp_folder,
            pairs=options.pairs,
            recipe_folder=recipe_path.parent,
        )
        fitting = own_fitting(recipe.kind, request)
    path = checkpoint_path(recipe, options, refinement)
    if path.exists() and not (options.resume or options.overwrite):
        raise ContractError(
            f"{path} is there already: give {option_text('resume')} to go on or "
            f"{option_text('overwrite')}"
        )
    options.out_dir.mkdir(parents=True, exist_ok=True)
    if material is None:
        limits = options.max_minutes, options.max_cpu_minutes
        with working(f"preparing the kernels of {recipe.name}"), limited(stopwatch, *limits):
            material = kind.prepare(recipe, recipe_path.parent, options.out_dir)
    # A pool of its own: another size may be trained beside this one.
    samples = options.out_dir / f"samples_{_label(role, options.size)}"
    seed = entry.schedule.seed
    what = f"{recipe.name} {_label(role, options.size)}"
    begin = stopwatch.wall_s(), stopwatch.cpu_s()
    with working(f"preparing the scenes of {what}"):
        pool = open_pool(samples, recipe_path, material, options.data_folder, seed=seed, role=role)
    with pool:
        pool.start_workers(options.workers)
        run = _Run(
            recipe,
            material,
            options,
            toml=recipe_path.read_text(encoding="utf-8"),
            refinement=refinement,
            first=first,
            fitting=fitting,
            stopwatch=stopwatch,
        )
        run.begin_s = begin
        return run.work(pool, what)


def checkpoint_path(recipe: Recipe, options: TrainOptions, refinement: Refinement | None) -> Path:
    """Return the file that a run writes its checkpoints to."""
    label = _label(recipe.role(options.role), options.size)
    name = f"{recipe.name}_{label}" + ("" if refinement is None else f"_{refinement.name}")
    return options.out_dir / f"{name}.pt"


def _label(role: str, size: str) -> str:
    return size if role == DEFAULT_ROLE else f"{role}_{size}"


class _Run:
    """A run in time: the loop with its clock, log, validation and checkpoints."""

    def __init__(
        self,
        recipe: Recipe,
        material: Material,
        options: TrainOptions,
        *,
        toml: str,
        refinement: Refinement | None,
        first: FirstWeights | None,
        fitting: OwnFitting | None,
        stopwatch: Stopwatch,
    ) -> None:
        self.stopwatch = stopwatch
        self.options, self.material_digest = options, material.digest()
        self.recipe, self.toml = recipe, toml
        self.designed = dict(material.designed)
        self.role = recipe.role(options.role)
        self.entry = recipe.network(options.size, self.role)
        kind = training_kind(recipe.kind)
        self._make_judge = partial(kind.judge, recipe, self.role, material, options.valid_folder)
        self.judge: Judge | None = None
        self.baselines: dict[str, float] = {}
        data = describe_data(recipe.data, options.data_folder)
        self.data = data + ("" if first is None else first.credit(data))
        if fitting is not None:
            self.data += fitting.credit
            self.fitter = fitting.make(material)
        elif refinement is None:
            objective = patch_objective(kind.finish(recipe, self.role))
            self.fitter = Fitter(
                self.entry, kind.build_network, options.device, first, objective=objective
            )
        else:
            self.data += refinement.credit
            self.entry = replace(self.entry, schedule=refinement.schedule)
            self.fitter = refinement.make_fitter(self.entry, material)
        self.steps = options.steps or self.entry.schedule.steps
        self.path = checkpoint_path(recipe, options, refinement)
        self.step, self.elapsed_before_s, self.cpu_before_s = 0, 0.0, 0.0
        self.valid: Score | None = None
        self.loss: float | None = None
        self.spent_s = (0.0, 0.0)
        # a loss of its own, an adversary say, wants something else than the decibels
        self.picks_best = refinement is None and fitting is None
        self.best: State = {}
        self.best_db: float | None = None
        if options.resume:
            self._restore(read_checkpoint(self.path))
        last_step = self.step if options.resume else None
        self.log = RunLog(self.path.with_suffix(".jsonl"), keep_until_step=last_step)
        self.closing_s: dict[str, tuple[float, float]] = {}
        self.setup_shares = (0.0, 0.0)
        self.begin_s = (0.0, 0.0)
        self.too_short = ""

    def _restore(self, saved: Checkpoint) -> None:
        identity = (self.material_digest, self.role, self.entry.network, dict(self.entry.config))
        if (saved.bank_digest, saved.role, saved.network, saved.config) != identity:
            raise ContractError(
                f"{self.path} was trained with other kernels or another network; "
                "start without resume"
            )
        self.fitter.load(saved.weights, saved.average, saved.optimizer)
        added = "" if self.data in saved.training_data else f"; then {self.data}"
        self.data = saved.training_data + added
        self.step = saved.step
        self.best, self.best_db = saved.best, saved.best_db
        self.elapsed_before_s, self.cpu_before_s = saved.elapsed_s, saved.cpu_s

    def elapsed_s(self) -> float:
        return self.elapsed_before_s + self.stopwatch.wall_s()

    def cpu_s(self, pool: SamplePool) -> float:
        return self.cpu_before_s + self.stopwatch.cpu_s() + pool.workers_cpu_s()

    def _closing(self, name: str, work: Callable[[], Returned]) -> Returned:
        """Run the work of the end of a run once, and record its (wall, CPU) seconds."""
        begin = self.stopwatch.wall_s(), self.stopwatch.cpu_s()
        returned = work()
        wall_s, cpu_s = self.stopwatch.wall_s(), self.stopwatch.cpu_s()
        self.closing_s[name] = wall_s - begin[0], cpu_s - begin[1]
        return returned

    def work(self, pool: SamplePool, what: str) -> TrainResult:
        """Prepare and train, and return the result."""
        if self.step or max(self._shares(pool)) < 1:
            with working(f"preparing the validation of {what}"):
                self.judge = self._make_judge()
                self.baselines = dict(self._closing("judge", self.judge.baselines))
        note(self._plan_line())
        with working(f"preparing the first samples of {what}", unit="samples") as task:
            self._prepare(pool, task)
        with working(f"training {what}", total=1.0, writes_lines=True) as task:
            self._loop(pool, task)
        return self._result()

    def _prepare(self, pool: SamplePool, task: Task) -> None:
        """Make the first samples, unless the time ends before."""
        begin_s = self.elapsed_s(), self.cpu_s(pool)

        def go_on(ready: int, total: int) -> bool:
            if task.total is None:
                task.begin(ready)
            task.count(ready, total)
            if not self._is_over(self._progress(pool)):
                return True
            making_s = self.elapsed_s() - begin_s[0], self.cpu_s(pool) - begin_s[1]
            samples = int(task.skipped), ready, total
            self.too_short = self._too_short(pool, samples, making_s)
            return False

        pool.make_ready(self.step, go_on)

    def _too_short(
        self, pool: SamplePool, samples: tuple[int, int, int], making_s: Sequence[float]
    ) -> str:
        """Return the line of a run whose time ended before its first step.

        Args:
            pool: Of its samples.
            samples: Those there at first, those there now, and those in all.
            making_s: Wall and CPU time of making some of them.
        """
        shares = self._shares(pool)
        which = shares.index(max(shares))
        limit = (self.options.max_minutes, self.options.max_cpu_minutes)[which]
        if self.step or limit is None or shares[which] < 1:
            return NO_STEP
        return short_time_text(
            f"{limit:g} {('minutes', 'CPU-minutes')[which]}",
            samples,
            spent_s=60 * limit * shares[which],
            kept_s=self.begin_s[which],
            making_s=making_s[which],
        )

    def _loop(self, pool: SamplePool, task: Task) -> None:
        """Fit until the schedule, the time or the asked step ends; checkpoint and validate."""
        schedule, options = self.entry.schedule, self.options
        task.begin(self._progress(pool))
        self.setup_shares, first_step = self._shares(pool), self.step
        self.log.write(
            {"step": self.step, "seconds": self.elapsed_s(), "cpu_s": self.cpu_s(pool)}
            | self._baseline_entries()
        )
        saved_s = validated_s = self.elapsed_s()
        losses: list[float] = []
        while not self._is_over(progress := self._progress(pool)):
            task.count(progress)
            decay = self._decay(pool)
            batch = pool.draw_batch(self.step, schedule.batch, schedule.patch_px)
            losses.append(self.fitter.fit(batch, self.step, decay))
            self.step += 1
            if self.step % LOG_STEPS == 0:
                self._log(pool, decay, sum(losses) / len(losses))
                losses.clear()
            if self.elapsed_s() - validated_s > options.validate_s:
                self._validate(pool, task)
                validated_s = self.elapsed_s()
            if self.elapsed_s() - saved_s > options.checkpoint_s:
                self._save(pool)
                saved_s = self.elapsed_s()
        task.count(1.0)
        if self.step == first_step and self.step not in (self.steps, options.stop_at_step):
            note(self.too_short or NO_STEP)
        self._validate(pool, task)
        self._save(pool)
        self.spent_s = self.elapsed_s(), self.cpu_s(pool)

    def _shares(self, pool: SamplePool) -> tuple[float, float]:
        """Return the shares of the wall and the CPU time that are spent, the end of the run too."""
        options = self.options
        wall_s, cpu_s = (sum(times_s[i] for times_s in self.closing_s.values()) for i in (0, 1))
        budgets = (
            (self.elapsed_s() + wall_s, options.max_minutes),
            (self.cpu_s(pool) + cpu_s, options.max_cpu_minutes),
        )
        wall, cpu = (0.0 if most is None else seconds / (60 * most) for seconds, most in budgets)
        return wall, cpu

    def _progress(self, pool: SamplePool) -> float:
        """Return the finished share of the run, 0..1."""
        return progress_of(self.step, self.steps, max(self._shares(pool)))

    def _decay(self, pool: SamplePool) -> float:
        """Return the finished share of the schedule; 0 before the first step."""
        pairs = zip(self._shares(pool), self.setup_shares, strict=True)
        of_steps = max((now - setup) / (1 - setup) for now, setup in pairs if setup < 1)
        return progress_of(self.step, self.steps, of_steps)

    def _is_over(self, progress: float) -> bool:
        return progress >= 1 or self.step == self.options.stop_at_step or self._is_interrupted()

    def _is_interrupted(self) -> bool:
        """Return whether the session ends, the last validation and checkpoint included."""
        minutes = self.options.session_minutes
        closing_s = sum(wall_s for wall_s, _ in self.closing_s.values())
        return minutes is not None and self.stopwatch.wall_s() + closing_s > 60 * minutes

    def _log(self, pool: SamplePool, progress: float, loss: float) -> None:
        self.loss = loss
        clock = {"seconds": self.elapsed_s(), "cpu_s": self.cpu_s(pool)}
        waited = {"waited_s": pool.waited_s, "progress": progress}
        self.log.write({"step": self.step, "loss": loss} | self.fitter.notes() | clock | waited)

    def _validate(self, pool: SamplePool, task: Task) -> None:
        judge = self.judge
        if judge is None:
            return
        self.valid = self._closing("judge", lambda: judge.score(self.fitter.restore))
        if self.picks_best and (self.best_db is None or self.valid.mean_db > self.best_db):
            self.best, self.best_db = self.fitter.average(), self.valid.mean_db
        entry: dict[str, Any] = {
            "step": self.step,
            "seconds": self.elapsed_s(),
            "cpu_s": self.cpu_s(pool),
            "valid_db": self.valid.mean_db,
        }
        parts = {f"valid_{name}": dict(part) for name, part in self.valid.parts.items()}
        self.log.write(entry | parts | self._baseline_entries())
        note(self._line(pool, task, self.valid.mean_db))

    def _plan_line(self) -> str:
        """Return the line about the end of the run."""
        ends = [f"{self.steps} steps"]
        budgets = {"minutes": self.options.max_minutes, "CPU-minutes": self.options.max_cpu_minutes}
        ends += [f"{most:g} {unit}" for unit, most in budgets.items() if most is not None]
        baseline_text = "".join(f", {name} {db:.2f} dB" for name, db in self.baselines.items())
        every = f"a line at every validation, about every {duration(self.options.validate_s)}"
        return f"{self.path.stem}: {' or '.join(ends)}{baseline_text}; {every}"

    def _line(self, pool: SamplePool, task: Task, valid_db: float) -> str:
        """Return the line of a validation."""
        loss = "" if self.loss is None else f", loss {self.loss:.4f}"
        line = f"{self.path.stem}: step {self.step} of {self.steps}{loss}, {valid_db:.2f} dB"
        for spent_s, most, unit in (
            (self.elapsed_s(), self.options.max_minutes, "minutes"),
            (self.cpu_s(pool), self.options.max_cpu_minutes, "CPU-minutes"),
        ):
            if most is not None:
                line += f", {spent_s / 60:.1f} of {most:g} {unit}"
        return line + left_text(task)

    def _baseline_entries(self) -> dict[str, float]:
        return {f"{name}_db": db for name, db in self.baselines.items()}

    def _save(self, pool: SamplePool) -> None:
        saved = Checkpoint(
            recipe_toml=self.toml,
            designed=self.designed,
            role=self.role,
            size=self.options.size,
            network=self.entry.network,
            config=dict(self.entry.config),
            bank_digest=self.material_digest,
            training_data=self.data,
            step=self.step,
            elapsed_s=self.elapsed_s(),
            cpu_s=self.cpu_s(pool),
            valid_db=None if self.valid is None else self.valid.mean_db,
            weights=self.fitter.weights(),
            average=self.fitter.average(),
            optimizer=self.fitter.optimizer_state(),
            best=self.best,
            best_db=self.best_db,
        )
        self._closing("save", lambda: write_checkpoint(self.path, saved))

    def _result(self) -> TrainResult:
        saved = read_checkpoint(self.path)
        return TrainResult(
            checkpoint=self.path,
            log=self.path.with_suffix(".jsonl"),
            steps=saved.step,
            elapsed_s=self.spent_s[0],
            cpu_s=self.spent_s[1],
            baselines=self.baselines,
            valid_db=float(saved.best_db or saved.valid_db or 0.0),
        )
