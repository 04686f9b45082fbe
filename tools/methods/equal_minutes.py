"""Every method trained for the same CPU-minutes, on the same samples, resumable.

    WORK_DIR/samples/        made once
    WORK_DIR/runs/NAME.pt    checkpoint; .jsonl its log; .json how it ended

CPU time is that of the process, on one thread: drawing, steps and checkpoints, without the samples.
The learning rate falls by the share of the minutes, so a slow network takes fewer steps of the
same schedule. Weights are averaged, as in `camkit train`; the last average counts, and nothing is
chosen by validation.
"""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.samples import finish_of
from camkit.models_def.torch_file import load_torch
from camkit.models_def.training.fitter import Fitter, Objective, patch_objective
from camkit.models_def.training.log import RunLog
from camkit.models_def.training.recipe import NetworkRecipe
from camkit.models_def.training.sample import Batch
from camkit.models_def.training.schedule import progress_of
from camkit.report.bench.machine import processor_name
from camkit.runtime.output.part_file import atomic_output
from tools.methods.method_list import METHODS, Method, run_blurred
from tools.methods.sample_store import SampleStore

BLOCK_PX: Final = 256
BLOCKS: Final = 3
"""In a step, in place of the recipe's patches: about as many judged pixels."""
WARM_UP_STEPS: Final = 50
LOG_STEPS: Final = 50
CHECKPOINT_S: Final = 60.0
NO_END: Final = 10**9
"""Steps: the minutes end a run."""

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """The time of every method.

    Attributes:
        minutes: Of the CPU.
        folder: Of checkpoints and logs.
    """

    minutes: float
    folder: Path

    def checkpoint(self, name: str) -> Path:
        """Return the file of a method's weights."""
        return self.folder / f"{name}.pt"

    def ending(self, name: str) -> dict[str, Any] | None:
        """Return how the training of a method ended; None where it did not."""
        path = self.checkpoint(name).with_suffix(".json")
        if not path.is_file():
            return None
        ending: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return ending

    def is_spent(self, name: str) -> bool:
        """Return whether a method was trained to the end, for these minutes."""
        ending = self.ending(name)
        return ending is not None and ending["minutes"] == self.minutes


def train_method(name: str, store: SampleStore, budget: Budget, tell: Tell) -> dict[str, Any]:
    """Train a method until its minutes are over, or go on where it was stopped; return its end.

    Raises:
        ContractError: If it was trained for another time.
    """
    ending = budget.ending(name)
    if ending is None:
        budget.folder.mkdir(parents=True, exist_ok=True)
        ending = _Training(name, store, budget).run()
        with atomic_output(budget.checkpoint(name).with_suffix(".json")) as part:
            part.write_text(json.dumps(ending) + "\n", encoding="utf-8")
    elif ending["minutes"] != budget.minutes:
        raise ContractError(
            f"{name} was trained for {ending['minutes']:g} CPU-minutes, not {budget.minutes:g}: "
            f"say so, or remove {budget.checkpoint(name).with_suffix('.*')}"
        )
    tell(f"{name}: {ending['steps']} steps in {ending['cpu_s']:.0f} CPU-s")
    return ending


def trained_network(name: str, budget: Budget) -> nn.Module:
    """Return the network of a method with its averaged weights."""
    network = METHODS[name].build()
    network.load_state_dict(_read(budget.checkpoint(name))["average"])
    return network.eval()


class _Training:
    """The training of one method."""

    def __init__(self, name: str, store: SampleStore, budget: Budget) -> None:
        self._name, self._store, self._budget = name, store, budget
        self._method = METHODS[name]
        schedule = replace(
            store.recipe.network("M").schedule,
            learning_rate=self._method.learning_rate,
            warmup_steps=WARM_UP_STEPS,
        )
        self._fitter = Fitter(
            NetworkRecipe(network=name, schedule=schedule),
            lambda _: self._method.build(),
            "cpu",
            objective=objective_of(self._method, store, budget),
        )
        self._step, self._spent_s = 0, 0.0
        path = budget.checkpoint(name)
        if path.is_file():
            saved = _read(path)
            self._fitter.load(saved["weights"], saved["average"], saved["optimizer"])
            self._step, self._spent_s = saved["step"], saved["cpu_s"]
        last_step = self._step if path.is_file() else None
        self._log = RunLog(path.with_suffix(".jsonl"), keep_until_step=last_step)
        self._began_s = time.process_time()

    def run(self) -> dict[str, Any]:
        """Train to the end; return what the record holds."""
        losses: list[float] = []
        saved_s = self._cpu_s()
        while (progress := self._progress()) < 1:
            losses.append(self._fitter.fit(self._draw(), self._step, progress))
            self._step += 1
            if self._step % LOG_STEPS == 0:
                self._write_log(losses)
                losses.clear()
            if self._cpu_s() - saved_s > CHECKPOINT_S:
                self._save()
                saved_s = self._cpu_s()
        self._save()
        if losses:
            self._write_log(losses)
        return {
            "minutes": self._budget.minutes,
            "cpu_s": round(self._cpu_s(), 1),
            "steps": self._step,
            "samples": len(self._store.stacks),
            "learning_rate": self._method.learning_rate,
            "parameters": sum(p.numel() for p in self._fitter.network.parameters()),
            "hardware": processor_name(),
            "torch": torch.__version__,
        }

    def _cpu_s(self) -> float:
        return self._spent_s + time.process_time() - self._began_s

    def _progress(self) -> float:
        return progress_of(self._step, NO_END, self._cpu_s() / (60 * self._budget.minutes))

    def _draw(self) -> Batch:
        schedule = self._fitter.schedule
        rng = np.random.default_rng((schedule.seed, self._step))
        if self._method.feeding == "kernels":
            return self._store.draw_blocks(rng, BLOCKS, BLOCK_PX)
        return self._store.draw(rng, schedule.batch, schedule.patch_px)

    def _write_log(self, losses: list[float]) -> None:
        loss = sum(losses) / len(losses)
        self._log.write({"step": self._step, "loss": loss, "cpu_s": round(self._cpu_s(), 1)})

    def _save(self) -> None:
        saved = {
            "weights": self._fitter.weights(),
            "average": self._fitter.average(),
            "optimizer": self._fitter.optimizer_state(),
            "step": self._step,
            "cpu_s": self._cpu_s(),
        }
        with atomic_output(self._budget.checkpoint(self._name)) as part:
            torch.save(saved, part)


def objective_of(method: Method, store: SampleStore, budget: Budget) -> Objective:
    """Return the loss of the recipe; behind the bank it is that of what the light bound leaves.

    Raises:
        ContractError: If the method has a teacher that is not trained.
    """
    if method.feeding == "kernels":
        return patch_objective(run=partial(run_blurred, scale=store.recipe.scale))
    if method.feeding == "capture":
        return patch_objective(run=_run_capture)
    finish = finish_of(store.recipe)
    objective = patch_objective(finish)
    if method.teacher is None:
        return objective
    if not budget.is_spent(method.teacher):
        raise ContractError(f"{method.title}: train {method.teacher} before it")
    teacher = trained_network(method.teacher, budget)

    def teach(batch: Batch) -> Tensor:
        output: Tensor = teacher(batch.planes)
        return output if finish is None else finish(output, batch)

    return taught(objective, teach)


def taught(objective: Objective, teach: Callable[[Batch], Tensor]) -> Objective:
    """Return the mean of a loss against the truth and against what a teacher makes of a batch."""

    def loss(fitter: Fitter, batch: Batch, step: int, progress: float) -> Tensor:
        with torch.no_grad():
            lesson = replace(batch, target=teach(batch))
        truth, learned = (objective.loss(fitter, one, step, progress) for one in (batch, lesson))
        return (truth + learned) / 2

    return Objective(loss=loss)


def _run_capture(fitter: Fitter, batch: Batch, progress: float) -> Tensor:
    return fitter.run(batch.inputs["capture"], progress)


def _read(path: Path) -> dict[str, Any]:
    saved: dict[str, Any] = load_torch(path, "checkpoint")
    return saved
