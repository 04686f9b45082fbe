"""A photograph waits for no more than it needs: the decoder starts first, libraries when used."""

import subprocess
import sys
from pathlib import Path

import pytest

from camkit.runtime.files import decoder

NEEDLESS = {"scipy", "onnx", "google", "matplotlib", "rawpy", "tifffile"}


@pytest.fixture(autouse=True)
def decoded_here() -> None:
    """Children decode here, as they do for users."""


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Give the arguments of every child that is started."""
    told: list[list[str]] = []
    real = decoder._started

    def listed(arguments: list[str], *, stdin: int) -> decoder.Decoder:
        told.append(list(arguments))
        return real(arguments, stdin=stdin)

    monkeypatch.setattr(decoder, "_started", listed)
    return told


def test_one_child_is_started_before_anything_and_decodes(
    captures: Path, camkit_command, started: list[list[str]]
) -> None:
    assert camkit_command("process", "a.dng", "--bundle", "tiny.camkit").code == 0
    assert [len(arguments) for arguments in started] == [1]
    assert (captures / "a.exr").is_file()


@pytest.mark.parametrize("words", [("a.dng", "--dry-run"), ("none.dng",), (".",), ("x.png",)])
def test_none_is_started_where_no_raw_file_comes_first(
    captures: Path, camkit_command, started: list[list[str]], words: tuple[str, ...]
) -> None:
    (captures / "x.png").write_bytes(b"no picture")
    camkit_command("process", *words, "--bundle", "tiny.camkit", "--out-dir", "out")
    assert [len(arguments) for arguments in started if len(arguments) == 1] == []


def test_a_photograph_is_made_without_libraries_that_it_does_not_need(
    captures: Path, tmp_path: Path
) -> None:
    code = (
        "import sys\nfrom camkit.cli.app import run\n"
        f"code = run(['process', 'a.dng', '--bundle', 'none', '--out-dir', {str(tmp_path)!r}])\n"
        "print('LOADED', *sorted(m for m in sys.modules if '.' not in m))\nsys.exit(code)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=captures
    )
    loaded = set(done.stdout.rpartition("LOADED")[2].split())
    assert "cv2" in loaded
    assert not loaded & NEEDLESS
