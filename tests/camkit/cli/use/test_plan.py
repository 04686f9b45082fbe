"""`camkit plan` says what `process` would do, with the same options, and writes nothing."""

import json
from pathlib import Path

import pytest

from camkit.cli.app import run
from camkit.runtime.output.writer import HELD_WHOLE
from tests.capture_factory import write_tiny_captures


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    """Write a capture a.dng beside its bundle."""
    return write_tiny_captures(tmp_path, ["a"])


def test_plan_prints_decisions_and_an_estimate(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["plan", str(tmp_path / "a.dng"), "--bundle", str(bundle), "--json"]
    assert run([*arguments, "--quality", "adaptive", "--out-dir", str(tmp_path / "out")]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["status"] == "planned"
    assert {d["what"] for d in facts["decisions"]} >= {"size", "cells", "blocks", "undistortion"}
    for decision in facts["decisions"]:
        assert set(decision) == {"what", "choice", "reason", "saving_s", "cost_db"}
        assert decision["saving_s"] is not None
    assert facts["estimate"]["seconds"] > 0
    assert facts["estimate"]["peak_mb"] > 100
    assert not (tmp_path / "out").exists()


def test_plan_and_dry_run_say_the_same_to_people(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [str(tmp_path / "a.dng"), "--bundle", str(bundle), "--size", "M"]
    outs = []
    for command in (["plan", *options], ["process", *options, "--dry-run"]):
        assert run(command) == 0
        lines = capsys.readouterr().out.splitlines()
        outs.append([line for line in lines if not line.startswith(("  about", "    saves"))])
    assert outs[0] == outs[1]
    assert any("size: M (set by --size)" in line for line in outs[0])


def test_what_a_format_holds_counts_in_a_plan_too(
    bundle: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(HELD_WHOLE, "jpeg", 1e6)
    options = [str(tmp_path / "a.dng"), "--bundle", str(bundle), "--out-dir", str(tmp_path / "o")]
    for command in (["plan"], ["process", "--dry-run"], ["process"]):
        assert run([*command, *options, "--format", "jpeg"]) == 1
        captured = capsys.readouterr()
        assert "raise --max-mem" in captured.out + captured.err
        assert run([*command, *options]) == 0
        capsys.readouterr()


def test_sidecar_keeps_the_plan_and_how_far_the_estimate_was_off(
    bundle: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    command = ["process", str(tmp_path / "a.dng"), "--bundle", str(bundle), "--out-dir", str(out)]
    assert run([*command, "--max-seconds", "1000"]) == 0
    plan = json.loads((out / "a.camkit.json").read_text(encoding="utf-8"))["plan"]
    assert plan["quality"] == "exact"
    assert plan["estimate"]["real_seconds"] > 0
    assert plan["estimate"]["seconds_ratio"] > 0
    assert [d["what"] for d in plan["decisions"]][:2] == ["size", "cells"]


def test_nothing_is_timed_where_nobody_asks_for_a_time(
    bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def timed(*_: object, **__: object) -> None:
        raise AssertionError("the machine is timed")

    monkeypatch.setattr("camkit.runtime.pipeline.measure_speed", timed)
    out = tmp_path / "out"
    assert (
        run(["process", str(tmp_path / "a.dng"), "--bundle", str(bundle), "--out-dir", str(out)])
        == 0
    )
    plan = json.loads((out / "a.camkit.json").read_text(encoding="utf-8"))["plan"]
    assert "estimate" not in plan


@pytest.mark.parametrize(
    "wrong", [["--quality", "poor"], ["--max-seconds", "0"], ["--max-error-db", "-1"]]
)
def test_a_wrong_choice_is_refused(bundle: Path, tmp_path: Path, wrong: list[str]) -> None:
    assert run(["plan", str(tmp_path / "a.dng"), "--bundle", str(bundle), *wrong]) == 2
