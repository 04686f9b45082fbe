"""The command line in this process: exit code, stdout and stderr of one call."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from camkit.cli.app import run
from tests.capture_factory import write_tiny_captures
from tests.decoded_here import decoded_here  # noqa: F401


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a caller sees of one command."""

    code: int
    out: str
    err: str


Command = Callable[..., Outcome]


@pytest.fixture
def camkit_command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:
    """Run one command line, which shows no progress however slow the machine is."""
    monkeypatch.setattr("camkit.cli.progress.SILENT_S", 1e6)

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        code = run([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return Outcome(code=int(code), out=out, err=err)

    return call


@pytest.fixture
def captures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a.dng, b.dng and tiny.camkit in it."""
    write_tiny_captures(tmp_path, ["a", "b"])
    monkeypatch.chdir(tmp_path)
    return tmp_path
