"""Inputs that are no plain files cost one line each; names of any bytes are processed."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.capture_factory import write_tiny_captures

LONG = "n" * 10_000 + ".dng"


@pytest.fixture
def odd(tmp_path: Path) -> list[str]:
    """A pipe, a device, a loop of links, a name that no file can have, a folder's link."""
    os.mkfifo(tmp_path / "pipe.dng")
    (tmp_path / "loop.dng").symlink_to("loop.dng")
    return [
        *(str(tmp_path / name) for name in ("pipe.dng", "loop.dng", LONG, "absent.dng")),
        "/dev/zero",
    ]


def test_what_is_no_file_fails_in_one_line_and_the_rest_lives(
    tmp_path: Path, odd: list[str], camkit_command: Any
) -> None:
    bundle = write_tiny_captures(tmp_path, ["good"])
    done = camkit_command(
        *("process", *odd, tmp_path / "good.dng", "--bundle", bundle),
        *("--out-dir", tmp_path / "out", "--json"),
    )
    told = [json.loads(line) for line in done.out.splitlines()]
    assert done.code == 1
    assert [one["status"] for one in told] == ["failed"] * len(odd) + ["ok"]
    for one, what in zip(
        told,
        ["a pipe", "symbolic links", "name too long", "No such file", "a device"],
        strict=False,
    ):
        assert what.lower() in one["error"].lower()
        assert "\n" not in one["error"]


@pytest.mark.parametrize("command", ["info", "plan"])
def test_other_commands_refuse_a_pipe_likewise(
    tmp_path: Path, odd: list[str], camkit_command: Any, command: str
) -> None:
    bundle = write_tiny_captures(tmp_path, ["good"])
    given = (command, odd[0]) if command == "info" else (command, odd[0], "--bundle", bundle)
    done = camkit_command(*given)
    assert done.code == 1
    assert "a pipe, not a file" in done.err + done.out


@pytest.mark.parametrize("format_", ["exr", "png", "tiff", "dng"])
def test_a_name_that_is_no_utf8_is_processed(tmp_path: Path, format_: str) -> None:
    bundle = write_tiny_captures(tmp_path, ["good"])
    name = os.fsdecode(b"shot\xe9")
    shot = (tmp_path / "good.dng").rename(tmp_path / f"{name}.dng")
    done = subprocess.run(
        [
            *(sys.executable, "-m", "camkit", "process", shot, "--bundle", str(bundle)),
            *("--out-dir", str(tmp_path / "out"), "--format", format_),
        ],
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    made = {path.name for path in (tmp_path / "out").iterdir()}
    suffix = {"tiff": "tif"}.get(format_, format_)
    assert made == {f"{name}.{suffix}", f"{name}.camkit.json"}
