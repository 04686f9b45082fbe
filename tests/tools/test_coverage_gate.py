"""The gate refuses what one of its parts refuses, and names every part."""

import subprocess
from collections.abc import Sequence
from typing import Any

import pytest

from tools import coverage_gate


@pytest.mark.parametrize(("refused", "code"), [(None, 0), (coverage_gate.RUNTIME, 2)])
def test_the_stricter_part_decides(
    refused: str | None,
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def answered(command: Sequence[str], **_: Any) -> subprocess.CompletedProcess[str]:
        fails = refused is not None and f"--include={refused}" in command
        return subprocess.CompletedProcess(command, 2 if fails else 0, stdout="93\n")

    monkeypatch.setattr(subprocess, "run", answered)
    assert coverage_gate.main() == code
    said = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0].removeprefix("branch coverage of ") for line in said] == [
        "runtime",
        "core",
        "tools",
    ]
    assert said[0].endswith("93 % (floor 90)")
