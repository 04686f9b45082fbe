"""Compact JSON and Markdown."""

import json
import math

from tools.tables.records import left_out_lines, markdown_table, to_compact_json


def test_floats_keep_their_digits_wherever_they_stand() -> None:
    text = to_compact_json({"db": [21.11254, (0.000123456,)], "n": 123456, "at": 1e3}, 4)
    assert text == '{"db":[21.11,[0.0001235]],"n":123456,"at":1000.0}'


def test_what_is_no_float_stays_as_it_is() -> None:
    plain = {"name": "duet", "seed": None, "kept": True, "captures": 810}
    assert json.loads(to_compact_json(plain, 2)) == plain


def test_numbers_without_end_are_read_back_as_such() -> None:
    found = json.loads(to_compact_json([math.inf, math.nan], 3))
    assert found[0] == math.inf
    assert math.isnan(found[1])


def test_a_table_has_a_line_for_each_row() -> None:
    table = markdown_table(["a", "b"], [["1", "2"], ["", "3"]])
    assert table == "| a | b |\n|---|---|\n| 1 | 2 |\n|  | 3 |"


def test_what_is_left_out_is_told_with_its_reason() -> None:
    record = {"rows": {"a": 1}, "rows_left_out": {"b": "no weights"}, "sets_left_out": {}}
    assert left_out_lines(record) == ["- b is left out: no weights"]
