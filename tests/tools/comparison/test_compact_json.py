import json
import math

from tools.comparison.compact_json import to_compact_json


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
