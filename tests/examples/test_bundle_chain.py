"""The pages of formulas name every stage, and their numbers are those of the code."""

import importlib
import re
from pathlib import Path
from typing import Any

import pytest

from camkit.bundle.manifest import Manifest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("bundle-chain", "bundle-streaks", "bundle-format")
TEXTS = {
    page: (ROOT / "docs" / "reference" / f"{page}.md").read_text(encoding="utf-8") for page in PAGES
}
TEXT = TEXTS["bundle-chain"]
ROWS = TEXT + TEXTS["bundle-streaks"]
ROW = re.compile(r"^\| `([a-z0-9_/]+)\.py` \| (.+) \|$", re.MULTILINE)
NUMBER = re.compile(r"(_?[A-Z][A-Z0-9_]*) (\([^)]*\)|[^,]+)")


def _value(text: str) -> float | tuple[float, ...]:
    """Return a number, a fraction, or several numbers in brackets."""
    if text.startswith("("):
        return tuple(float(part) for part in text.strip("()").split())
    top, _, bottom = text.partition("/")
    return float(top) / float(bottom or 1)


def _numbers() -> list[tuple[str, str, str]]:
    return [(module, *pair) for module, row in ROW.findall(ROWS) for pair in NUMBER.findall(row)]


def _module(path: str) -> Any:
    name = path.replace("/", ".")
    return importlib.import_module(name if name.startswith("camkit.") else f"camkit.{name}")


@pytest.mark.parametrize("path", [module for module, _ in ROW.findall(ROWS)])
def test_the_numbers_of_the_page_are_those_of_the_code(path: str) -> None:
    module = _module(path)
    numbers = [(name, text) for place, name, text in _numbers() if place == path]
    assert numbers
    for name, text in numbers:
        assert getattr(module, name) == pytest.approx(_value(text), rel=1e-12), name


def test_every_stage_has_its_formulas_or_is_named_among_those_to_refuse() -> None:
    headings = re.findall(r"^## (.+)$", TEXT, re.MULTILINE)
    formulas, _, refused = TEXT.partition("## What a reader may refuse")
    defs = Manifest.model_json_schema()["$defs"].values()
    types = {
        part["properties"].get("type", {}).get("const") for part in defs if "properties" in part
    }
    stages = {name for name in types if name is not None and f"`{name}`" in _table_of_stages()}
    assert len(stages) > 15
    for name in stages:
        headed = any(name in heading.split(" and ") for heading in headings)
        assert headed or f"**{name}**" in formulas or f"`{name}`" in refused, name


def test_every_anchor_of_the_pages_exists() -> None:
    anchors = {page: _anchors(text) for page, text in TEXTS.items()}
    for page, text in TEXTS.items():
        for other, anchor in re.findall(r"\]\((?:([a-z-]+)\.md)?#([^)]+)\)", text):
            if (other or page) in anchors:
                assert anchor in anchors[other or page], f"{page}: {anchor}"


def _anchors(text: str) -> set[str]:
    """Return the anchors of the headings of a page, as GitHub makes them."""
    lines = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^a-z0-9 _-]", "", line.lower()).replace(" ", "-") for line in lines}


def _table_of_stages() -> str:
    after = TEXTS["bundle-format"].partition("### stages, planes, products")[2]
    return after.partition("### networks")[0]
