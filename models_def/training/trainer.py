"""The trainer: fits one network of a recipe, resumes exactly, ends in time.

pool of samples -> patches of a step -> network -> loss in the square-root domain -> AdamW
                                                        -> average of the weights -> validation
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import torch

from camkit.errors import ContractError
from camkit.models_def.networks.catalog import build_network, check_patch
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import Lens, format_prescription
from camkit.models_def.training.checkpoint import (
    Checkpoint,
    read_checkpoint,
    write_checkpoint,
)
from camkit.models_def.training.credits import describe_data
from camkit.models_def.training.first_weights import (
    FirstWeights,
    read_first_weights,
    take_first_weights,
)
from camkit.models_def.training.fitter import Fits, Fitter
from camkit.models_def.training.lens_bank import build_lens_bank
from camkit.models_def.training.log import RunLog
from camkit.models_def.training.pool import SamplePool, open_pool
from camkit.models_def.training.progress import TrainingBar
from camkit.models_def.training.psf_bank import PsfBank
from camkit.models_def.training.recipe import (
    NetworkRecipe,
    Recipe,
    ScheduleRecipe,
    read_recipe,
)
from camkit.models_def.training.schedule import progress_of
from camkit.models_def.training.validation import (
    Score,
    ValidationCapture,
    make_validation_captures,
    score,
    score_capture,
    score_wiener,
)

LOG_STEPS: Final = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainOptions:
    """What a run is given besides its recipe.

    Attributes:
        out_dir: Checkpoint, log and sample pool are kept here.
        size: Which network of the recipe.
        data_folder: Pictures to train on; None for procedural scenes alone.
        valid_folder: Pictures to choose by; None for procedural scenes.
        steps: Steps of the whole schedule; None for the recipe's.
        max_minutes: Wall time after which the schedule, decay included, ends; None for its steps.
        start: Checkpoint or bundle with the same network, of another camera say, whose weights
            are the first ones; None for random weights.
        stop_at_step: Stop there though the schedule goes on, as an interruption would.
        resume: Go on from the checkpoint in `out_dir`.
        overwrite: Start anew over a checkpoint that lies there.
        threads: Threads of torch.
        workers: Processes that make samples; 0 makes them in this process.
        device: cpu or cuda.
        checkpoint_s: Seconds between checkpoints.
        validate_s: Seconds between validations.
    """

    out_dir: Path
    size: str = "M"
    data_folder: Path | None = None
    valid_folder: Path | None = None
    steps: int | None = None
    max_minutes: float | None = None
    start: Path | None = None
    stop_at_step: int | None = None
    resume: bool = False
    overwrite: bool = False
    threads: int = 1
    workers: int = 1
    device: str = "cpu"
    checkpoint_s: float = 100.0
    validate_s: float = 180.0

    def __post_init__(self) -> None:
        if self.max_minutes is not None and self.max_minutes <= 0:
            raise ContractError(f"max_minutes must be > 0; got {self.max_minutes}")
        if self.steps is not None and self.steps < 1:
            raise ContractError(f"steps must be >= 1; got {self.steps}")
        if self.start is not None and self.resume:
            raise ContractError("a run that is resumed has begun; leave start away")
        if self.overwrite and self.resume:
            raise ContractError("resume goes on from the checkpoint, overwrite drops it: say one")
        if self.threads < 1 or self.workers < 0:
            raise ContractError(
                f"threads must be >= 1, workers >= 0; got {self.threads}, {self.workers}"
            )
        if self.device != "cpu" and not torch.cuda.is_available():
            raise ContractError(f"device {self.device} is not there; use cpu")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainResult:
    """How a run ended.

    Attributes:
        checkpoint: The last checkpoint.
        log: The log.
        steps: Steps done, earlier runs included.
        elapsed_s: Wall time, earlier runs included.
        cpu_s: CPU time, workers and earlier runs included.
        capture_db: Validation PSNR of the captures.
        wiener_db: Of the Wiener bank alone.
        valid_db: Of the network.
    """

    checkpoint: Path
    log: Path
    steps: int
    elapsed_s: float
    cpu_s: float
    capture_db: float
    wiener_db: float
    valid_db: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement:
    """Later training of a trained network, with its own files, schedule and fitter.

    Attributes:
        name: Behind the size in the names of its files.
        schedule: Used instead of the network's.
        make_fitter: From the network's entry, with that schedule, and the kernels.
        first: Weights that the fitter starts from.
        credit: What it adds to the training data, for the card.
    """

    name: str
    schedule: ScheduleRecipe
    make_fitter: Callable[[NetworkRecipe, PsfBank], Fits]
    first: FirstWeights | None = None
    credit: str = ""


Stage = Refinement
"""As `training.final` calls it."""


def train(
    recipe_path: Path,
    options: TrainOptions,
    *,
    bank: PsfBank | None = None,
    refinement: Refinement | None = None,
) -> TrainResult:
    """Train one network of a recipe.

    Args:
        recipe_path: TOML recipe.
        options: Where, how long and with what.
        bank: Kernels to train with; None traces the recipe's lens (about a minute, kept in
            `out_dir`).
        refinement: Later training; None fits a new network to the recipe's loss.

    Raises:
        ContractError: If recipe, options or the checkpoint to resume do not fit.
    """
    torch.set_num_threads(options.threads)
    recipe = read_recipe(recipe_path)
    entry = recipe.network(options.size)
    schedule = entry.schedule if refinement is None else refinement.schedule
    # before anything is traced
    network = build_network(entry.network, **entry.config)
    check_patch(entry.network, network, schedule.patch_px)
    first = None if refinement is None else refinement.first
    if options.start is not None:
        if refinement is not None:
            raise ContractError("a refinement has its own start; leave start away")
        first = read_first_weights(options.start, options.size)
    if first is not None:
        take_first_weights(network, first)
    path = checkpoint_path(recipe, options, refinement)
    if path.exists() and not (options.resume or options.overwrite):
        raise ContractError(f"{path} is there already: give --resume to go on or --overwrite")
    options.out_dir.mkdir(parents=True, exist_ok=True)
    seed = entry.schedule.seed
    lens = find_lens(recipe.lens.prescription, recipe_path.parent)
    if bank is None:
        bank = build_lens_bank(recipe, lens, options.out_dir)
    # A pool of its own: another size may be trained beside this one.
    samples = options.out_dir / f"samples_{options.size}"
    pool = open_pool(samples, recipe_path, bank, options.data_folder, seed=seed)
    with pool, TrainingBar(f"{recipe.name} {options.size}") as bar:
        pool.start_workers(options.workers)
        captures = make_validation_captures(recipe, bank, options.valid_folder)
        run = _Run(recipe_path, lens, bank, captures, options, refinement, first)
        run.loop(pool, bar)
        return run.result()


def checkpoint_path(recipe: Recipe, options: TrainOptions, refinement: Refinement | None) -> Path:
    """Give the file that a run writes its checkpoints to."""
    name = f"{recipe.name}_{options.size}" + ("" if refinement is None else f"_{refinement.name}")
    return options.out_dir / f"{name}.pt"


class _Run:
    """A run in time: the loop with its clock, log, validation and checkpoints."""

    def __init__(
        self,
        recipe_path: Path,
        lens: Lens,
        bank: PsfBank,
        captures: list[ValidationCapture],
        options: TrainOptions,
        refinement: Refinement | None,
        first: FirstWeights | None,
    ) -> None:
        self.options, self.valid_captures = options, captures
        self.bank_digest = bank.digest()
        self.toml = recipe_path.read_text(encoding="utf-8")
        self.lens_toml = format_prescription(lens)
        self.recipe: Recipe = read_recipe(recipe_path)
        self.entry = self.recipe.network(options.size)
        data = describe_data(self.recipe, options.data_folder)
        self.data = data + ("" if first is None else first.credit(data))
        if refinement is None:
            self.fitter: Fits = Fitter(self.entry, options.device, first)
        else:
            self.data += refinement.credit
            self.entry = replace(self.entry, schedule=refinement.schedule)
            self.fitter = refinement.make_fitter(self.entry, bank)
        self.steps = options.steps or self.entry.schedule.steps
        self.path = checkpoint_path(self.recipe, options, refinement)
        self.step, self.elapsed_before_s, self.cpu_before_s = 0, 0.0, 0.0
        self.valid: Score | None = None
        if options.resume:
            self._restore(read_checkpoint(self.path))
        until = self.step if options.resume else None
        self.log = RunLog(self.path.with_suffix(".jsonl"), keep_until_step=until)
        self.capture = score_capture(captures, self.recipe)
        self.wiener = score_wiener(captures, self.recipe)
        self.start_s, self.start_cpu_s = time.perf_counter(), time.process_time()

    def _restore(self, saved: Checkpoint) -> None:
        known = (self.bank_digest, self.entry.network, dict(self.entry.config))
        if (saved.bank_digest, saved.network, saved.config) != known:
            raise ContractError(
                f"{self.path} was trained with other kernels or another network; "
                "start without resume"
            )
        self.fitter.load(saved.weights, saved.average, saved.optimizer)
        added = "" if self.data in saved.training_data else f"; then {self.data}"
        self.data = saved.training_data + added
        self.step = saved.step
        self.elapsed_before_s, self.cpu_before_s = saved.elapsed_s, saved.cpu_s

    def elapsed_s(self) -> float:
        return self.elapsed_before_s + time.perf_counter() - self.start_s

    def cpu_s(self, pool: SamplePool) -> float:
        own = time.process_time() - self.start_cpu_s
        return self.cpu_before_s + own + pool.workers_cpu_s()

    def loop(self, pool: SamplePool, bar: TrainingBar) -> None:
        """Fit until the schedule, the time or the asked step ends; checkpoint and validate."""
        schedule, options = self.entry.schedule, self.options
        budget_s = None if options.max_minutes is None else 60 * options.max_minutes
        pool.draw_batch(self.step, 1, schedule.patch_px)
        self.log.write(
            {"step": self.step, "seconds": self.elapsed_s(), "cpu_s": self.cpu_s(pool)}
            | {"capture_db": self.capture.mean_db, "wiener_db": self.wiener.mean_db}
        )
        saved_s = validated_s = self.elapsed_s()
        losses: list[float] = []
        while not self._is_over(progress := self._progress(budget_s)):
            batch = pool.draw_batch(self.step, schedule.batch, schedule.patch_px)
            losses.append(self.fitter.fit(batch, self.step, progress))
            self.step += 1
            if self.step % LOG_STEPS == 0:
                self._note(pool, bar, progress, sum(losses) / len(losses))
                losses.clear()
            if self.elapsed_s() - validated_s > options.validate_s:
                self._validate(pool)
                validated_s = self.elapsed_s()
            if self.elapsed_s() - saved_s > options.checkpoint_s:
                self._save(pool)
                saved_s = self.elapsed_s()
        self._validate(pool)
        self._save(pool)

    def _progress(self, budget_s: float | None) -> float:
        return progress_of(self.step, self.steps, self.elapsed_s(), budget_s)

    def _is_over(self, progress: float) -> bool:
        return progress >= 1 or self.step == self.options.stop_at_step

    def _note(self, pool: SamplePool, bar: TrainingBar, progress: float, loss: float) -> None:
        valid_db = None if self.valid is None else self.valid.mean_db
        bar.show(progress, self.step, loss, valid_db)
        clock = {"seconds": self.elapsed_s(), "cpu_s": self.cpu_s(pool)}
        waited = {"waited_s": pool.waited_s, "progress": progress}
        self.log.write({"step": self.step, "loss": loss} | self.fitter.notes() | clock | waited)

    def _validate(self, pool: SamplePool) -> None:
        self.valid = score(self.valid_captures, self.recipe, self.fitter.restore)
        entry: dict[str, Any] = {
            "step": self.step,
            "seconds": self.elapsed_s(),
            "cpu_s": self.cpu_s(pool),
            "valid_db": self.valid.mean_db,
            "valid_by_iso": {f"{iso:g}": db for iso, db in self.valid.by_iso.items()},
            "valid_by_field": {f"{f:g}": db for f, db in self.valid.by_field.items()},
            "capture_db": self.capture.mean_db,
            "wiener_db": self.wiener.mean_db,
        }
        self.log.write(entry)

    def _save(self, pool: SamplePool) -> None:
        saved = Checkpoint(
            recipe_toml=self.toml,
            lens_toml=self.lens_toml,
            size=self.options.size,
            network=self.entry.network,
            config=dict(self.entry.config),
            bank_digest=self.bank_digest,
            training_data=self.data,
            step=self.step,
            elapsed_s=self.elapsed_s(),
            cpu_s=self.cpu_s(pool),
            valid_db=None if self.valid is None else self.valid.mean_db,
            weights=self.fitter.weights(),
            average=self.fitter.average(),
            optimizer=self.fitter.optimizer_state(),
        )
        write_checkpoint(self.path, saved)

    def result(self) -> TrainResult:
        saved = read_checkpoint(self.path)
        return TrainResult(
            checkpoint=self.path,
            log=self.path.with_suffix(".jsonl"),
            steps=saved.step,
            elapsed_s=saved.elapsed_s,
            cpu_s=saved.cpu_s,
            capture_db=self.capture.mean_db,
            wiener_db=self.wiener.mean_db,
            valid_db=float(saved.valid_db or 0.0),
        )
