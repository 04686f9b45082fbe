"""A recipe with another value of a key."""

import math
import tomllib

import pytest

from camkit.errors import ContractError
from tools.tables.recipe_text import with_keys


def test_keys_of_one_table_are_changed():
    text = "a = 1\n[lens]\na = 2 # old\nb = 3\n[lens.more]\na = 4\n"
    changed = tomllib.loads(with_keys(text, "lens", {"a": 5, "c": [1.0, math.inf]}))
    assert changed == {"a": 1, "lens": {"a": 5, "c": [1, math.inf], "b": 3, "more": {"a": 4}}}


@pytest.mark.parametrize(
    ("text", "message"),
    [("[data]\n", r"no table \[lens\]"), ("[lens]\na = [\n1,\n]\n", "on many lines")],
)
def test_what_cannot_be_changed_is_said(text, message):
    with pytest.raises(ContractError, match=message):
        with_keys(text, "lens", {"a": 1.0})
