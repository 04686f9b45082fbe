"""Tests of the pages of reference that the code writes."""

import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

from camkit.models_def.design.design_recipe import TABLES, to_design
from camkit.models_def.optics.configuration.configuration_table import ConfigurationTable
from camkit.models_def.optics.search.improvement import RANGES
from camkit.models_def.optics.search.variables import KINDS, PARAMETERS
from tools.reference import __main__ as program
from tools.reference.recipe_page import EXAMPLE, attribute_texts


@pytest.mark.parametrize("page", program.PAGES)
def test_generated_pages_are_what_the_code_says(page: str) -> None:
    assert program.PAGES[page]() == (program.FOLDER / page).read_text(encoding="utf-8"), (
        "run `python -m tools.reference`"
    )


def test_the_page_of_recipes_explains_every_key_and_its_example_is_a_recipe() -> None:
    for kind in (*TABLES.values(), ConfigurationTable):
        texts = attribute_texts(kind)
        assert list(texts) == [field.name for field in fields(kind)], kind
        assert all(len(text.split()) > 1 and text.endswith(".") for text in texts.values()), kind
    assert to_design(tomllib.loads(EXAMPLE)).prescription == "cooke-triplet"
    assert {*RANGES} == {*KINDS} == {*PARAMETERS}


def test_the_command_writes_every_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program, "FOLDER", tmp_path)
    monkeypatch.setattr(program, "PAGES", dict.fromkeys(program.PAGES, lambda: "a page"))
    program.main()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys(
        program.PAGES, "a page"
    )
