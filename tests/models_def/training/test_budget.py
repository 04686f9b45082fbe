"""A budget of time counts all of a run, and what a run says of itself."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from camkit import stopwatch as stopwatch_module
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer import lens_bank
from camkit.models_def.kinds.bayer.validation import BayerJudge
from camkit.models_def.training import trainer
from camkit.models_def.training.fitter import Fitter
from camkit.models_def.training.kind import read_recipe
from camkit.models_def.training.pool import SamplePool, open_pool
from camkit.models_def.training.trainer import TrainOptions, train
from camkit.progress import Board, listening
from camkit.stopwatch import Stopwatch

PART_S = 10.0


class _Clock:
    """CPU time that passes where a test says so; children that have ended are counted apart."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.own_s, self.children_s = 500.0, 70.0
        monkeypatch.setattr(stopwatch_module.time, "process_time", lambda: self.own_s)
        monkeypatch.setattr(os, "times", self._times)

    def _times(self) -> SimpleNamespace:
        return SimpleNamespace(children_user=self.children_s - 1, children_system=1.0)

    def spend(self) -> None:
        self.own_s += PART_S

    def spend_in_child(self) -> None:
        self.children_s += PART_S


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> _Clock:
    return _Clock(monkeypatch)


def test_a_stopwatch_counts_own_time_and_that_of_ended_children_from_its_start(clock) -> None:
    watch, whole = Stopwatch(), Stopwatch.of_process()
    clock.spend()
    clock.spend_in_child()
    assert watch.cpu_s() == pytest.approx(2 * PART_S)
    assert whole.cpu_s() == pytest.approx(570 + 2 * PART_S)


def _costs(owner: Any, name: str) -> Callable[[pytest.MonkeyPatch, Callable[[], None]], None]:
    """Return what makes every call of a function cost a part."""

    def patch(monkeypatch: pytest.MonkeyPatch, spend: Callable[[], None]) -> None:
        real = getattr(owner, name)

        def slow(*arguments: Any, **named: Any) -> Any:
            spend()
            return real(*arguments, **named)

        monkeypatch.setattr(owner, name, slow)

    return patch


PARTS = {
    "opening the pool": _costs(trainer, "open_pool"),
    "first samples and steps": _costs(SamplePool, "draw_batch"),
    "steps": _costs(Fitter, "fit"),
    "what needs no network": _costs(BayerJudge, "baselines"),
    "validation": _costs(BayerJudge, "score"),
    "checkpoint": _costs(trainer, "write_checkpoint"),
    "reading the recipe": _costs(trainer, "read_recipe"),
}


def _options(folder: Path, **changes: Any) -> TrainOptions:
    return TrainOptions(**({"out_dir": folder, "size": "S", "workers": 0} | changes))


@pytest.mark.parametrize("where", ["spend", "spend_in_child"])
def test_every_part_of_a_run_counts(
    tmp_path, recipe_path, material, monkeypatch, clock, where: str
) -> None:
    spent: list[str] = []

    def spends(part: str) -> Callable[[], None]:
        def spend() -> None:
            getattr(clock, where)()
            spent.append(part)

        return spend

    for part, patch in PARTS.items():
        patch(monkeypatch, spends(part))
    result = train(recipe_path, _options(tmp_path, stop_at_step=2), material=material)
    assert set(spent) == set(PARTS)
    assert result.cpu_s == pytest.approx(PART_S * len(spent))


def test_kernels_that_are_traced_count(tmp_path, recipe_path, material, monkeypatch, clock) -> None:
    kind = trainer.training_kind("bayer")

    def prepare(*_: object) -> object:
        clock.spend()
        return material

    monkeypatch.setattr(type(kind), "prepare", prepare)
    result = train(recipe_path, _options(tmp_path, stop_at_step=1))
    assert result.cpu_s == pytest.approx(PART_S)


def test_a_limit_ends_the_tracing_of_kernels_and_a_repeat_goes_on_from_those_that_are_kept(
    tmp_path, recipe_path, monkeypatch, clock
) -> None:
    traced: list[float] = []

    def spot(lens: Any, _: Any, heights_mm: Any, *, size_px: int, **__: Any) -> Any:
        clock.spend()
        traced.append(lens.object_distance_mm)
        kernels = np.zeros((heights_mm.size, 3, size_px, size_px), np.float32)
        kernels[..., size_px // 2, size_px // 2] = 1
        return kernels, 1.0

    monkeypatch.setattr(lens_bank, "colour_kernels", spot)
    lens = read_recipe(recipe_path).lens
    total = 1 + lens.copies + lens.validation_copies
    short = _options(tmp_path, max_cpu_minutes=2.5 * PART_S / 60)
    text = rf"after 20 s of .* 2 of {total} copies .* another takes 10 s; .* other {total - 2} in"
    with pytest.raises(ContractError, match=text):
        train(recipe_path, short)
    assert len(traced) == 2
    assert train(recipe_path, _options(tmp_path, stop_at_step=1)).steps == 1
    assert len(traced) == total
    assert not [*tmp_path.glob("bank-*.npy")]


def test_what_was_spent_before_the_call_counts_by_the_stopwatch_of_the_command(
    tmp_path, recipe_path, material, clock
) -> None:
    watch = Stopwatch()
    clock.spend()
    result = train(
        recipe_path,
        _options(tmp_path, max_cpu_minutes=PART_S / 60),
        material=material,
        stopwatch=watch,
    )
    assert (result.steps, result.cpu_s) == (0, PART_S)


def test_the_last_validation_fits_into_the_budget(
    tmp_path, recipe_path, material, monkeypatch, clock
) -> None:
    for part in ("steps", "what needs no network", "validation", "checkpoint"):
        PARTS[part](monkeypatch, clock.spend)
    given = _options(tmp_path, size="M", max_cpu_minutes=1.5, checkpoint_s=0.0)
    result = train(recipe_path, given, material=material)
    assert 0 < result.steps < 60
    assert 90 - 2 * PART_S <= result.cpu_s <= 90 + PART_S


def test_workers_count_from_their_start_while_they_work_and_when_they_have_ended(
    tmp_path, recipe_path, material
) -> None:
    watch = Stopwatch()
    with open_pool(tmp_path, recipe_path, material, None, seed=1) as pool:
        pool.start_workers(1)
        end = time.monotonic() + 60
        while not pool.workers_cpu_s() and time.monotonic() < end:
            time.sleep(0.02)
        at_work_s = pool.workers_cpu_s()
        assert at_work_s > 0.2, "it has imported torch, and made no sample yet"
    assert pool.workers_cpu_s() == 0
    assert watch.cpu_s() >= at_work_s, "counted once, as an ended child"


def test_a_run_says_its_plan_and_a_line_at_every_validation(
    tmp_path, recipe_path, material
) -> None:
    lines: list[str] = []
    given = _options(tmp_path, max_minutes=60.0, validate_s=0.0)
    with listening(Board(note=lines.append)):
        result = train(recipe_path, given, material=material)
    assert lines[0].startswith("tiny_S: 12 steps or 60 minutes, capture ")
    assert lines[0].endswith("; a line at every validation, about every 0 s")
    assert len(lines) == 2 + result.steps
    assert lines[1].startswith("tiny_S: step 1 of 12")
    assert "about" in lines[6]
    assert lines[6].endswith(" left")
    assert f"{result.valid_db:.2f} dB" in " ".join(lines)
    assert "left" not in lines[-1]
    assert " of 60 minutes" in lines[-1]


def test_the_schedule_begins_at_the_first_step_whatever_came_before(
    tmp_path, recipe_path, material, monkeypatch, clock
) -> None:
    decays: list[float] = []
    fit = Fitter.fit

    def noted(self: Fitter, batch: Any, step: int, progress: float) -> float:
        clock.spend()
        decays.append(progress)
        return fit(self, batch, step, progress)

    monkeypatch.setattr(Fitter, "fit", noted)
    PARTS["opening the pool"](monkeypatch, lambda: [clock.spend() for _ in range(5)])
    train(recipe_path, _options(tmp_path, max_cpu_minutes=2.0), material=material)
    assert decays[0] == 0
    assert decays == sorted(decays)
    assert 0.8 < decays[-1] < 1


def test_a_run_without_a_step_says_so(tmp_path, recipe_path, material, clock) -> None:
    lines: list[str] = []
    watch = Stopwatch()
    clock.spend()
    with listening(Board(note=lines.append)):
        train(
            recipe_path,
            _options(tmp_path, max_cpu_minutes=PART_S / 60),
            material=material,
            stopwatch=watch,
        )
    assert any("no step was trained" in line for line in lines)


def test_a_limit_ends_the_first_samples_and_the_run_says_what_it_needs(
    tmp_path, recipe_path, material, monkeypatch, clock
) -> None:
    PARTS["opening the pool"](monkeypatch, clock.spend)
    _costs(SamplePool, "_make_missing")(monkeypatch, clock.spend)
    lines: list[str] = []
    shown: list[str] = []
    board = Board(note=lines.append)
    make = SamplePool._make_missing

    def seen(pool: SamplePool) -> None:
        shown.append(" ".join(task.what for task in board.tasks))
        assert not any(task.writes_lines for task in board.tasks), "the display shows it"
        make(pool)

    monkeypatch.setattr(SamplePool, "_make_missing", seen)
    given = _options(tmp_path, max_cpu_minutes=3.5 * PART_S / 60)
    with listening(board):
        result = train(recipe_path, given, material=material)
        first = read_recipe(recipe_path).data.first_samples
        assert (result.steps, len(shown)) == (0, 3)
        assert set(shown) == {"preparing the first samples of tiny S"}
        (line,) = [line for line in lines if "no step was trained" in line]
        assert f"(3 of {first} samples) is kept" in line
        assert f"about {(1 + first) * PART_S / 60:.1f} of 0.583333 CPU-minutes" in line
        assert f"needs about {(1 + first - 3) * PART_S / 60:.1f} for them" in line
        more = _options(tmp_path, max_cpu_minutes=60.0, overwrite=True, stop_at_step=1)
        assert train(recipe_path, more, material=material).steps == 1
    assert len(shown) == first, "those of the first run are kept"
