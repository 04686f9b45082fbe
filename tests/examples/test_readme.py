"""The runnable blocks of README and docs run as they stand, one after the other in one folder.

Where the built-in bundle is not there (a checkout in which it was not exported yet), a tiny bundle
takes its place and the capture its size.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from camkit.bundle.reader import built_in_bundles
from tests.bundle_factory import write_tiny_bundle

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```(sh|python) runnable\n(.*?)^```$", re.DOTALL | re.MULTILINE)
STAND_IN = {
    "--bundle duet": "--bundle tiny.camkit",
    '"duet"': '"tiny.camkit"',
    "640,480": "96,64",
    "(480, 640)": "(64, 96)",
}
SHELL = (
    'camkit() { "$PYTHON" -c "from camkit.cli import main; main()" "$@"; }\n'
    'python() { "$PYTHON" "$@"; }\n'
)


PAGES = [
    path
    for path in sorted((ROOT / "docs").glob("*.md"))
    if BLOCK.search(path.read_text(encoding="utf-8"))
]


def _blocks(page: Path = ROOT / "README.md") -> list[tuple[str, str]]:
    return [(kind, text) for kind, text in BLOCK.findall(page.read_text(encoding="utf-8"))]


def _run(kind: str, text: str, folder: Path) -> str:
    environment = {**os.environ, "PYTHON": sys.executable, "PYTHONPATH": str(ROOT)}
    if kind == "python":
        (folder / "script.py").write_text(text, encoding="utf-8")
        command = [sys.executable, "script.py"]
    else:
        command = ["bash", "-e", "-c", SHELL + text]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{text}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def test_every_runnable_block_runs_and_leaves_what_the_readme_says(tmp_path: Path) -> None:
    blocks = _blocks()
    assert [kind for kind, _ in blocks] == ["sh", "python"]
    if "duet" not in built_in_bundles():
        write_tiny_bundle(tmp_path)
        for old, new in STAND_IN.items():
            blocks = [(kind, text.replace(old, new)) for kind, text in blocks]
    printed = [_run(kind, text, tmp_path) for kind, text in blocks]
    for name in ("out/shot.exr", "out/shot.camkit.json", "out-png/shot.png", "out-python/shot.tif"):
        assert (tmp_path / name).is_file(), name
    assert "['ok']" in printed[1]


def test_the_python_block_has_eight_lines_and_no_main_guard() -> None:
    (text,) = [text for kind, text in _blocks() if kind == "python"]
    assert len(text.splitlines()) == 8
    assert "__main__" not in text


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_every_runnable_block_of_a_page_runs(page: Path, tmp_path: Path) -> None:
    for kind, text in _blocks(page):
        _run(kind, text, tmp_path)
