"""The site has every page of the manuals once and loads nothing from another host."""

import re
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tools.site import __main__ as building
from tools.site.__main__ import LOADED, mended_page

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs"


def _entries(nav: Any) -> Iterator[str]:
    if isinstance(nav, str):
        yield nav
    else:
        for part in nav.values() if isinstance(nav, dict) else nav:
            yield from _entries(part)


def test_the_navigation_has_every_page_once() -> None:
    settings = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))
    entries = list(_entries(settings["project"]["nav"]))
    named = [entry for entry in entries if "*" not in entry]
    assert len(named) == len(set(named))
    assert not [entry for entry in named if not (DOCS / entry).is_file()]
    matched = {path for entry in entries if "*" in entry for path in DOCS.glob(entry)}
    pages = set(DOCS.rglob("*.md"))
    assert pages == matched | {DOCS / entry for entry in named}


def test_a_page_loads_nothing_from_another_host_and_shows_plain_pipes() -> None:
    page = '<script src="https://unpkg.com/iframe-worker/shim"></script><code>A\\|B\\|C</code>'
    mended = mended_page(page, "../")
    assert LOADED.findall(page)
    assert not LOADED.findall(mended)
    assert "<code>A|B|C</code>" in mended
    assert re.search(r'src="\.\./assets/javascripts/file_worker\.js"', mended)


@pytest.mark.parametrize(("page", "code"), [("<p>one</p>", 0), ('<img src="https://a.b/c">', 1)])
def test_a_built_page_is_mended_and_foreign_ones_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, page: str, code: int
) -> None:
    (tmp_path / "assets" / "javascripts").mkdir(parents=True)
    (tmp_path / "index.html").write_text(page)
    monkeypatch.setattr(building, "SITE", tmp_path)
    done = subprocess.CompletedProcess((), 0)
    monkeypatch.setattr(building.subprocess, "run", lambda *_, **__: done)
    assert building.main() == code
    assert (tmp_path / "assets" / "javascripts" / building.WORKER).is_file()
    monkeypatch.setattr(
        building.subprocess, "run", lambda *_, **__: subprocess.CompletedProcess((), 3)
    )
    assert building.main() == 3
