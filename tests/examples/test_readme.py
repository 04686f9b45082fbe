"""The runnable blocks of README and docs run as they stand, one after the other in one folder.

Where the built-in bundle is not there (a checkout in which it was not exported yet), a tiny bundle
takes its place and the capture its size.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from camkit.bundle.reader import built_in_bundles
from tests.bundle_factory import write_tiny_bundle
from tools.pictures.views import VIEWS

BENCH = "docs/results/bench/bench.json"
ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
BASELINES = "spad-sr-baselines"
"""Other samplings of the array of `spad-sr`, to compare with; no camera of its own."""
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
    for path in sorted((ROOT / "docs").rglob("*.md"))
    if BLOCK.search(path.read_text(encoding="utf-8"))
]


def _blocks(page: Path = README) -> list[tuple[str, str]]:
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
    for name in (
        "out/shot.exr",
        "out/shot.camkit.json",
        "developed/shot.png",
        "out-python/shot.tif",
    ):
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


def test_the_first_screen_is_short_and_in_the_order_that_a_reader_needs() -> None:
    text = README.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 120
    parts = ("**camkit ", "![", "- **", "**What it is not.**", "make demo", "## Use it",
             "## Built-in cameras", "images/front.png", "## From Python",
             "## Where to go next", "## Known limits", "## Citation and licence")  # fmt: skip
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    first = text.split("\n\n")[1]
    assert len(first.split()) <= 50


def test_the_pictures_of_the_documents_are_small() -> None:
    files = list((ROOT / "docs" / "images").iterdir())
    assert {path.suffix for path in files} <= {".jpg", ".png"}
    assert max(path.stat().st_size for path in files) <= 150_000
    assert sum(path.stat().st_size for path in files) <= 1_500_000


def test_every_camera_with_a_view_has_its_pictures_its_row_and_its_section() -> None:
    assert set(VIEWS) == set(built_in_bundles()) - {BASELINES}
    text, gallery = README.read_text("utf-8"), (ROOT / "docs" / "gallery.md").read_text("utf-8")
    assert [row[0] for row in _table(text)] == list(VIEWS)
    assert re.findall(r"^## `([a-z0-9-]+)`", gallery, re.MULTILINE) == list(VIEWS)
    for name in VIEWS:
        assert f"(docs/images/{name}-small.jpg)" in text
        assert f"(images/{name}.jpg)" in gallery
    assert gallery.count("**Still wrong:**") == len(VIEWS)


def test_the_table_of_cameras_says_what_was_measured() -> None:
    rows = json.loads((ROOT / BENCH).read_text(encoding="utf-8"))["rows"]
    filtered = {row["bundle"] for row in rows if row["method"] == "wiener"}
    measured = {row["bundle"]: row for row in rows if row["size"] == "M" and row["method"] == "net"}
    measured = {name: measured[name] for name in filtered & measured.keys()}
    table = {name: (decibels, seconds) for name, decibels, seconds in _table(README.read_text())}
    assert set(measured) < set(table)
    for name, row in measured.items():
        gained_db = row["psnr_db"] - row["input_psnr_db"]
        assert table[name] == (f"{gained_db:.1f}", f"{row['s_per_24mp']:.1f}")


def _table(text: str) -> list[tuple[str, str, str]]:
    """Return camera, decibels and seconds of every row of the README's table of cameras."""
    rows = re.findall(r"^\| !.*? \| `([^`]+)` \| .*? \| (\S+) \| ([^|]+) \|$", text, re.MULTILINE)
    return [(name, decibels, seconds.strip()) for name, decibels, seconds in rows]
