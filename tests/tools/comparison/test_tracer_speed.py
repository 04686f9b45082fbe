"""The table of tracers: rows of what runs, a line for what does not."""

import json
import sys
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from tests.tiny_design import run_tool
from tools.comparison import compile_time
from tools.comparison.tracer_speed import interleaved, off_um


def test_a_row_says_how_fast_and_how_far_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lens = Path("models_def/prescriptions/cooke-triplet.toml")
    sizes = ("--rays", "64", "--rounds", "1", "--precisions", "float32", "--plain")
    out = ("--json", tmp_path / "out.json", "--optiland", sys.executable)
    run_tool(monkeypatch, "comparison.tracer_speed", lens, *sizes, *out)
    text = capsys.readouterr().out
    assert "optiland, torch: ModuleNotFoundError" in text
    (row,) = json.loads((tmp_path / "out.json").read_text())
    assert (row["program"], row["rays"], row["rays_arrived"]) == ("camkit", 64, 64)
    assert 0 < row["off_um"] < 1
    assert row["forward"] > 0
    assert row["both"] > 0


def test_a_program_without_gradient_has_no_number_there() -> None:
    answers = {"a": lambda _: {"seconds": 2.0}, "b": lambda _: {"error": "no gradient"}}
    medians = interleaved(answers, "both", 3)
    assert medians["a"] == 2.0
    assert medians["b"] != medians["b"]
    assert off_um({"x": [0.0], "y": [3e-3]}, {"x": [4e-3], "y": [0.0]}) == pytest.approx(5.0)


def test_the_second_process_is_the_second_number(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    seconds = iter((103.4, 4.2))
    monkeypatch.setattr(
        compile_time.subprocess,
        "run",
        lambda *_, **__: CompletedProcess([], 0, stdout=f"noise\n{next(seconds)}\n"),
    )
    run_tool(monkeypatch, "comparison.compile_time", "duet.toml", "--json", tmp_path / "out.json")
    assert capsys.readouterr().out == "duet: first process 103.4 CPU-s, second 4.2\n"
    assert json.loads((tmp_path / "out.json").read_text())["second_s"] == 4.2
