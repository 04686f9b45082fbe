"""Recipes as text: every key is there, says what it is, and reads back to the same recipe."""

import tomllib
from dataclasses import fields
from itertools import pairwise

import pytest

from camkit.bundle.stages import Wiener
from camkit.models_def.kinds.bayer.recipe import BayerDataRecipe, LensRecipe
from camkit.models_def.recipe_text import attribute_notes, table_lines
from camkit.models_def.training.recipe import ScheduleRecipe


@pytest.mark.parametrize("kind", [BayerDataRecipe, LensRecipe, ScheduleRecipe])
def test_every_key_of_a_table_is_written_with_what_it_is(kind: type) -> None:
    lines = table_lines("part", kind, {"prescription": "x.zmx"})
    table = tomllib.loads("\n".join(lines))["part"]
    absent = {f.name for f in fields(kind)} - table.keys()  # type: ignore[arg-type]
    # tables of their own, and what is empty by default
    assert absent <= {
        "display",
        "wild",
        "depths_mm",
        "depth_shares",
        "content",
        "critic",
        "uncertainty",
    }
    for before, line in pairwise(lines):
        assert line.startswith(("#", "[")) or not line or before.startswith("#"), line
    assert max(map(len, lines)) <= 100


def test_values_stand_in_place_of_defaults_and_keys_may_be_left_out() -> None:
    values = {"prior_scale": 1.0, "prior_exponent": 2.0, "block_px": 64, "overlap_px": 32}
    lines = table_lines("wiener", Wiener, values, left_out=("type", "takes", "gives"))
    table = tomllib.loads("\n".join(lines))["wiener"]
    assert values.items() <= table.items()
    assert not {"type", "takes", "gives", "together"} & table.keys()


def test_what_a_key_is_comes_from_the_docstrings_of_a_class_and_its_bases() -> None:
    notes = attribute_notes(BayerDataRecipe)
    assert notes["iso_max"] == "Highest ISO."
    # of a base, on two lines there
    assert notes["picture_share"].startswith("Share of crops from pictures, 0 to 1; the rest")
    assert notes["picture_share"].endswith("without a folder of pictures, is procedural.")


def test_what_is_no_table_is_refused() -> None:
    with pytest.raises(TypeError, match="neither a dataclass nor a model"):
        table_lines("part", int, {})
