"""A record is the same twice, a changed sample is reported, and two checkouts are timed."""

import copy
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest

from camkit.cli.app import run
from tools.evidence import __main__ as command
from tools.evidence import captures, checkout, record
from tools.evidence.captures import Capture
from tools.evidence.comparison import compare

TINY = {"tiny": ("procedural:1", "--size-px", "96,64")}


@pytest.fixture
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """One small capture, two ways, and two commands."""

    def some_commands(_bundle: str, taken: list[Capture]) -> list[tuple[str, ...]]:
        return [("info", taken[0].path.name), ("process", taken[0].path.name)]

    monkeypatch.setattr(captures, "PHOTOGRAPHS", TINY)
    monkeypatch.setattr(record, "PHOTOGRAPHS", ({}, {"method": "rl"}))
    monkeypatch.setattr(record, "FIRST_PHOTOGRAPH", ())
    monkeypatch.setattr(record, "WITHOUT_BUNDLE", ())
    monkeypatch.setattr("tools.evidence.commands._usual", some_commands)


def _here(self: checkout.Checkout, words: list[str]) -> tuple[CompletedProcess[str], float]:
    """Run `camkit` in this process."""
    with chdir(self.work), redirect_stdout(StringIO()) as said:
        code = int(run(words))
    return CompletedProcess(words, code, stdout=said.getvalue(), stderr=""), 0.1


@pytest.mark.usefixtures("_small")
def test_a_record_is_the_same_twice_and_a_changed_sample_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = [tmp_path / "before.json", tmp_path / "after.json"]
    for path in paths:
        assert command.main(["record", str(path), "--bundle", "streak-rank1"]) == 0
        monkeypatch.setattr(checkout.Checkout, "command", _here)  # which saves three starts
    assert command.main(["compare", *map(str, paths)]) == 0
    assert "12 entries equal, 0 changed" in capsys.readouterr().out
    before = command.read_record(paths[0])
    entries = before["entries"]
    assert "method must be one of" in entries["streak-rank1 tiny method=rl"]["refused"]
    written = entries["camkit process streak-rank1-tiny.dng"]
    assert written["json"][0]["output"] == "out/streak-rank1-tiny.exr"
    assert written["files"].keys() == {"streak-rank1-tiny.exr", "streak-rank1-tiny.camkit.json"}
    after = copy.deepcopy(before)
    after["entries"]["streak-rank1 tiny default"]["hashes"]["image"] = "0"
    del after["entries"]["camkit info streak-rank1-tiny.dng"]
    lines = list(compare(before, after).lines())
    assert lines[0] == "camkit info streak-rank1-tiny.dng"
    assert lines[2] == "streak-rank1 tiny default"
    assert lines[3].startswith("    hashes.image: ")
    assert "10 entries equal, 2 changed" in lines[4]


@pytest.mark.usefixtures("_small")
def test_two_checkouts_are_timed_in_turn(capsys: pytest.CaptureFixture[str]) -> None:
    root = str(checkout.HERE)
    assert command.main(["seconds", root, root, "--bundle", "streak-rank1", "--rounds", "1"]) == 0
    *_, tiny, last = capsys.readouterr().out.splitlines()
    assert tiny.startswith("streak-rank1 tiny")
    assert 0.05 < float(last.rpartition(" ")[2]) < 20


def test_large_photographs_are_timed_and_compared(capsys: pytest.CaptureFixture[str]) -> None:
    root = str(checkout.HERE)
    words = ["--whole", "duet:S", "--rounds", "1", "--megapixels", "0.2", "--threads", "1"]
    assert command.main(["seconds", root, root, *words]) == 0
    *_, cpu, clock, peak, agreed = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in (cpu, clock, peak)] == ["cpu_s", "clock_s", "peak_mb"]
    assert all(0.02 < float(line.split()[-1]) < 50 for line in (cpu, clock, peak))
    assert agreed == "duet:S same sum"


def test_a_worker_that_dies_is_replaced_and_its_entry_says_so(tmp_path: Path) -> None:
    here = checkout.Checkout(root=checkout.HERE, work=tmp_path)
    with checkout.Worker(here) as worker:
        missing: dict[str, Any] = {"bundle": "streak-rank1", "options": {}}
        assert "exit code 1" in worker.ask(missing)["failed"]
        refused = worker.ask({"bundle": "nobody", "options": {}, "capture": "a.dng"})["refused"]
        assert refused.startswith("BundleError: ")
