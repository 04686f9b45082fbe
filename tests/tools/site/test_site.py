"""The site has every page of the manuals once and loads nothing from another host."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

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
