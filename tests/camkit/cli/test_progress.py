"""What is said while a command works: on a terminal, without one, and when it is quick."""

import io
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from camkit.cli import progress as display_module
from camkit.cli.app import run
from camkit.cli.progress import Display, outer, showing_progress, tasks_text, time_left
from camkit.cli.say import say
from camkit.progress import Task, counted, duration, listening, note, working
from tests.capture_factory import write_tiny_captures


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class _Clock:
    """Time that passes when a test says so, for display and tasks alike."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 1000.0
        monkeypatch.setattr(display_module.time, "monotonic", lambda: self.now_s)
        self.display = Display("camkit try")

    def after(self, seconds: float) -> None:
        self.now_s += seconds
        self.display.tick(self.now_s)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> _Clock:
    return _Clock(monkeypatch)


def _begun(clock: _Clock, what: str = "blurring", **facts: Any) -> Task:
    task = Task(what=what, since_s=clock.now_s, **facts)
    clock.display.board.tasks.append(task)
    return task


@pytest.mark.parametrize("stream", [None, "closed"])
def test_a_command_needs_no_stderr(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], stream: str | None
) -> None:
    closed = io.StringIO()
    closed.close()
    monkeypatch.setattr(sys, "stderr", stream and closed)
    assert run(["info", "duet"]) == 0
    assert "name: duet" in capsys.readouterr().out


def test_a_single_unit_shows_what_lies_in_it_and_no_share(clock, capsys) -> None:
    _begun(clock, "merging", total=1, unit="brackets")
    _begun(clock, "reading", total=8, unit="frames").count(2)
    clock.after(3)
    said = capsys.readouterr().err
    assert "merging; reading, 2 of 8 frames, 25 %" in said


def test_a_loop_that_ended_early_leaves_no_task(clock) -> None:
    board = clock.display.board
    with listening(board), working("outside"):
        loop = counted([1, 2], "inside")
        next(loop)
        assert [task.what for task in board.tasks] == ["outside", "inside"]
        with working("later"):
            loop.close()
            assert [task.what for task in board.tasks] == ["outside", "later"]
        left = counted([1, 2], "left")
        next(left)
    assert board.tasks == []


def test_nothing_is_said_within_two_seconds(clock, capsys) -> None:
    _begun(clock)
    clock.after(1.9)
    assert capsys.readouterr().err == ""


def test_without_a_terminal_a_line_says_what_is_done_and_then_how_long_it_takes(
    clock, capsys
) -> None:
    task = _begun(clock, total=8, unit="scenes")
    clock.after(2)
    assert capsys.readouterr().err == "camkit try: blurring, 0 of 8 scenes, 0 %; 2 s so far\n"
    task.count(2)
    clock.after(2)
    line = "camkit try: blurring, 2 of 8 scenes, 25 %; 4 s so far, about 12 s left\n"
    assert capsys.readouterr().err == line


@pytest.mark.parametrize(("unit_s", "minutes", "most"), [(0.5, 1, 8), (60, 20, 21), (1, 60, 90)])
def test_lines_are_ten_seconds_apart_or_a_unit_and_further_in_long_runs(
    clock, capsys, unit_s: float, minutes: float, most: int
) -> None:
    task = _begun(clock, total=10_000)
    for done in range(int(60 * minutes / unit_s)):
        task.count(done)
        for _ in range(max(1, int(unit_s / 10))):
            clock.after(min(unit_s, 10))
    lines = capsys.readouterr().err.splitlines()
    assert 5 <= len(lines) <= most * max(1, unit_s / 30)


def test_work_without_news_is_said_to_go_on(clock, capsys) -> None:
    _begun(clock, what="solving")
    for _ in range(60):
        clock.after(1)
    assert len(capsys.readouterr().err.splitlines()) == 2


def test_time_left_leaves_out_what_was_done_before(clock) -> None:
    task = _begun(clock, total=100, unit="pictures")
    task.skipped = task.done = 80
    assert time_left([task], clock.now_s + 5) == ""
    task.count(90)
    assert time_left([task], clock.now_s + 50) == ", about 50 s left"


def test_time_left_follows_the_first_of_equal_units_and_not_what_prepares_them(clock) -> None:
    task = Task(what="judging", least_share=0.0, since_s=clock.now_s - 40)
    task.begin(0)
    task.count(0, 200)
    assert time_left([task], clock.now_s + 3) == ""
    task.count(4)
    assert time_left([task], clock.now_s + 2) == ", about 1 min 38 s left"


def test_work_within_a_unit_changes_neither_the_line_nor_the_time_left(clock) -> None:
    whole, part = _begun(clock, total=4, unit="pictures"), _begun(clock, total=10)
    whole.count(1)
    part.count(9)
    told = outer([whole, part])
    assert tasks_text(told) == "blurring, 1 of 4 pictures, 25 %"
    assert time_left(told, clock.now_s + 10) == ", about 30 s left"


def test_steps_that_differ_promise_no_end_but_that_of_the_step(clock) -> None:
    whole = _begun(clock, what="checking laws", total=7, is_even=False)
    whole.count(6)
    part = _begun(clock, what="measuring", total=4)
    part.count(1)
    told = outer([whole, part])
    assert tasks_text(told) == "step 7 of 7: checking laws; measuring, 25 %"
    assert time_left(told, clock.now_s + 10) == ", about 30 s left of this step"
    assert time_left(outer([whole]), clock.now_s + 10) == ""


def test_lines_of_the_work_stand_for_those_of_the_clock(clock, capsys) -> None:
    with working("training"):
        note("nobody listens: nothing is said")
    _begun(clock, writes_lines=True)
    clock.after(2)
    for _ in range(100):
        clock.after(10)
    clock.display.board.note("step 50: 31.2 dB")
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["camkit try: blurring; 2 s so far", "step 50: 31.2 dB"]


def test_lines_of_quick_work_are_not_shown(clock, capsys) -> None:
    clock.display.board.note("tracing")
    assert capsys.readouterr().err == ""
    _begun(clock)
    clock.after(3)
    assert capsys.readouterr().err.splitlines()[0] == "tracing"


def test_on_a_terminal_one_line_is_rewritten_and_results_take_its_place(
    monkeypatch, capsys
) -> None:
    terminal = _Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    clock = _Clock(monkeypatch)
    task = _begun(clock, what="\x1b[2Jodd\nname.dng", total=4, unit="pictures")
    for done in range(1, 4):
        task.count(done)
        clock.after(2)
    say("a.exr")
    assert terminal.getvalue().count("\n") == 0
    assert terminal.getvalue().endswith("\r\x1b[K")
    assert "\x1b[2J" not in terminal.getvalue()
    assert "odd name.dng, 3 of 4 pictures, 75 %; 6 s so far, about 2 s left" in terminal.getvalue()
    assert capsys.readouterr().out == "a.exr\n"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.7, "1 min 00 s"), (185, "3 min 05 s"), (640, "11 min"), (9000, "2.5 h")],
)
def test_times_are_said_as_people_say_them(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_the_clock_of_a_command_stops_with_it(monkeypatch, capsys) -> None:
    monkeypatch.setattr(display_module, "SILENT_S", 0.01)
    with showing_progress("camkit try"), working("waiting"):
        time.sleep(0.1)
    said = capsys.readouterr().err
    assert said.startswith("camkit try: waiting; 0 s so far\n")
    time.sleep(0.05)
    assert capsys.readouterr().err == ""


def test_a_stderr_that_nobody_reads_stops_no_work(monkeypatch) -> None:
    class Gone(io.StringIO):
        def write(self, _: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr(display_module, "SILENT_S", 0.01)
    monkeypatch.setattr(sys, "stderr", Gone())
    with showing_progress("camkit try"):
        assert list(counted(range(3), "counting")) == [0, 1, 2]
        time.sleep(0.1)


def test_a_task_that_fails_leaves_the_board(clock) -> None:
    from camkit.progress import listening

    with listening(clock.display.board):
        with pytest.raises(ZeroDivisionError), working("dividing"):
            raise ZeroDivisionError
        assert clock.display.board.tasks == []


Call = Callable[[Path], list[str]]
COMMANDS: dict[str, Call] = {
    "process": lambda d: ["process", str(d / "a.dng"), str(d / "b.dng"), *_bundle(d), *_out(d)],
    "plan": lambda d: ["plan", str(d / "a.dng"), *_bundle(d), *_out(d)],
    "check": lambda d: ["check", str(d / "tiny.camkit")],
    "simulate": lambda d: [
        *("simulate", "procedural:1", "--size-px", "64,48", *_bundle(d)),
        *("-o", str(d / "new.dng")),
    ],
}


def _bundle(folder: Path) -> list[str]:
    return ["--bundle", str(folder / "tiny.camkit")]


def _out(folder: Path) -> list[str]:
    return ["--out-dir", str(folder / "out")]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_slow_command_says_what_it_does_on_stderr_and_its_json_stays_whole(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tiny_captures(tmp_path, ["a", "b"])
    monkeypatch.setattr(display_module, "SILENT_S", 0.0)
    monkeypatch.setattr(display_module, "REDRAW_S", 0.001)
    monkeypatch.setattr(display_module, "LINE_S", 0.0)
    monkeypatch.setattr(display_module, "STILL_S", 0.0)
    assert run([*COMMANDS[name](tmp_path), "--json"]) == 0
    out, err = capsys.readouterr()
    assert all(isinstance(json.loads(line), dict) for line in out.splitlines())
    lines = [line for line in err.splitlines() if line.startswith(f"camkit {name}: ")]
    assert lines
    assert all("so far" in line for line in lines)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_quick_command_says_nothing_of_its_progress(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tiny_captures(tmp_path, ["a", "b"])
    monkeypatch.setattr(display_module, "SILENT_S", 1e6)
    assert run(COMMANDS[name](tmp_path)) == 0
    assert "so far" not in capsys.readouterr().err
