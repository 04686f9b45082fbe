"""Tools that start `camkit` in a process of its own get it in this one: a start costs a second."""

import subprocess
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

import pytest

from camkit.cli.app import run
from tests.decoded_here import decoded_here  # noqa: F401


@pytest.fixture
def camkit_in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    honest: Callable[..., subprocess.CompletedProcess[str]] = subprocess.run

    def called(command: Sequence[str], **options: Any) -> subprocess.CompletedProcess[str]:
        if list(command[1:3]) != ["-m", "camkit"]:
            return honest(command, **options)
        with redirect_stdout(StringIO()) as said:
            code = int(run(list(command[3:])))
        return subprocess.CompletedProcess(command, code, stdout=said.getvalue(), stderr="")

    monkeypatch.setattr(subprocess, "run", called)
