"""Success of searches for a start: both are asked for the same lens."""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.search.improvement import refracting_surfaces
from tools.start import success
from tools.start.success import (
    ARMS,
    LIBRARY,
    NO_FORM,
    RANDOM,
    TASKS,
    Run,
    problem_of,
    run_search,
    table_of,
)


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_the_random_search_knows_the_form_and_none_of_its_numbers(task: success.Task) -> None:
    problem, form = problem_of(task), find_lens(task.form)
    free = problem.free
    assert [s.glass for s in free.lens.surfaces] == [s.glass for s in form.surfaces]
    assert free.lens.stop == form.stop
    assert not any(s.curvature_per_mm or s.conic or s.even_asphere for s in free.lens.surfaces)
    bent = {v.surface for v in free.variables if v.kind == "curvature"}
    assert bent | {free.solved} == set(refracting_surfaces(form))
    assert free.lens.aperture_value == task.f_number
    corner = math.tan(math.radians(task.half_field_deg))
    torch.testing.assert_close(float(problem.slopes[-1]), corner)


def test_a_run_stops_after_its_seconds_and_names_where_it_began() -> None:
    task = replace(TASKS[1], half_field_deg=10.0)
    random_run, library_run = (run_search(task, arm, 1, 0.1) for arm in (RANDOM, LIBRARY))
    assert (random_run.rounds, library_run.rounds) == (1, 1)
    assert (random_run.start, library_run.start) == ("", "cooke-triplet")
    assert 0 < library_run.spot_um < 40


def test_success_is_counted_within_five_percent_of_the_best() -> None:
    spots = {RANDOM: (10.6, 30.0, 12.0), LIBRARY: (10.0, 10.4, 10.5)}
    runs = [
        Run(task="t", arm=arm, seed=i, spot_um=um, start="", rounds=1, cpu_s=1.0)
        for arm, ums in spots.items()
        for i, um in enumerate(ums)
    ]
    line = table_of(runs).splitlines()[2]
    assert line == "| t | 10.0 um | 0/3, 12.0 | 3/3, 10.4 | 0/0, nan |"
    assert table_of(runs).splitlines()[-1] == "| all |  | 0/3 | 3/3 | 0/0 |"


def test_the_command_prints_the_table_and_writes_every_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def quick(task: success.Task, arm: str, seed: int, seconds: float) -> Run:
        return Run(
            task=task.name, arm=arm, seed=seed, spot_um=9.0, start="", rounds=1, cpu_s=2 * seconds
        )

    monkeypatch.setattr(success, "run_search", quick)
    out = tmp_path / "runs.json"
    words = ["success", "--seconds", "2", "--seeds", "2", "--tasks", "normal", "-o", str(out)]
    monkeypatch.setattr(sys, "argv", words)
    said: list[str] = []
    success.main(said.append)
    assert "| normal, four | 9.0 um | 2/2, 9.0 | 2/2, 9.0 | 2/2, 9.0 |" in said[-1]
    table = json.loads(out.read_text())
    assert len(table["runs"]) == 2 * 2 * len(ARMS)
    spent = {run["arm"]: run["cpu_s"] for run in table["runs"]}
    # the random search may spend what the library took
    assert spent == {RANDOM: 8.0, LIBRARY: 4.0, NO_FORM: 4.0}
    assert [task["name"] for task in table["tasks"]] == ["normal, three", "normal, four"]
