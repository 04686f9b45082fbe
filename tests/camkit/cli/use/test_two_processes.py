"""Two runs over one folder: every capture is made by exactly one of them, none is lost."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from camkit.runtime.output.claim import claimed
from tests.capture_factory import write_tiny_captures

NAMES = [f"shot{number}" for number in range(12)]


@pytest.mark.parametrize("option", ["--resume", "--overwrite"])
def test_each_capture_is_made_by_exactly_one(tmp_path: Path, option: str) -> None:
    bundle = write_tiny_captures(tmp_path, NAMES)
    out = tmp_path / "out"
    command = [
        *("process", f"{tmp_path}/*.dng", "--json", option),
        *("--bundle", str(bundle), "--out-dir", str(out)),
    ]
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", TOGETHER, str(tmp_path / f"listed{n}"), *command],
            stdout=subprocess.PIPE,
            text=True,
        )
        for n in range(2)
    ]
    told = [json.loads(line) for run in runs for line in run.communicate()[0].splitlines()]
    assert [run.returncode for run in runs] == [0, 0]
    made = [Path(one["output"]).stem for one in told if one["status"] == "ok"]
    assert sorted(made) == sorted(NAMES)
    assert {one["status"] for one in told} == {"ok", "skipped"}
    assert sorted(p.name for p in out.iterdir()) == sorted(
        f"{name}{suffix}" for name in NAMES for suffix in (".exr", ".camkit.json")
    )


def test_what_another_process_makes_is_skipped_and_says_so(
    tmp_path: Path, camkit_command: Any
) -> None:
    bundle = write_tiny_captures(tmp_path, ["a"])
    with claimed(tmp_path / "a.exr"):
        done = camkit_command(
            *("process", tmp_path / "a.dng", "--bundle", bundle, "--out-dir", tmp_path, "--json")
        )
    told = json.loads(done.out)
    assert (done.code, told["status"]) == (0, "skipped")
    assert told["warnings"] == ["another process makes this picture"]
    assert not (tmp_path / "a.exr").exists()


TOGETHER = """
import sys, time
from pathlib import Path
from camkit.cli import main
from camkit.runtime.batch import processing

list_tasks, mark = processing.list_tasks, Path(sys.argv.pop(1))

def list_then_wait(*args, **kwargs):
    tasks = list_tasks(*args, **kwargs)
    mark.touch()
    while len(list(mark.parent.glob("listed*"))) < 2:
        time.sleep(0.01)
    return tasks

processing.list_tasks = list_then_wait
main()
"""
