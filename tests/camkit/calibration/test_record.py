"""Records as TOML: what was written is read, what TOML cannot hold is refused."""

import math
import tomllib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.calibration.record import to_toml
from camkit.errors import ContractError

TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
NUMBERS = st.integers() | st.floats(allow_nan=False, allow_infinity=False)
VALUES = st.booleans() | NUMBERS | TEXTS
LISTS = st.lists(VALUES, max_size=5) | st.lists(st.lists(NUMBERS, max_size=4), max_size=4)
RECORDS = st.recursive(
    st.dictionaries(TEXTS, VALUES | LISTS, max_size=4),
    lambda inner: st.dictionaries(TEXTS, VALUES | inner | st.lists(inner, max_size=3), max_size=4),
    max_leaves=8,
)


@given(RECORDS)
def test_a_record_reads_back_as_it_was(record: dict[str, Any]) -> None:
    assert tomllib.loads(to_toml(record)) == record


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_no_digit_of_a_number_is_lost(value: float) -> None:
    read = tomllib.loads(to_toml({"x": value}))["x"]
    assert type(read) is float
    assert math.copysign(1, read) == math.copysign(1, value)
    assert read == value


def test_kinds_of_numbers_stay_apart() -> None:
    read = tomllib.loads(to_toml({"flag": True, "count": 1, "share": 1.0}))
    assert [type(value) for value in read.values()] == [bool, int, float]


def test_a_number_of_numpy_that_is_a_float_is_written_as_one() -> None:
    assert to_toml({"x": np.float64(0.1)}) == "x = 0.1\n"


def test_tuples_read_back_as_lists() -> None:
    assert tomllib.loads(to_toml({"x": (1, 2), "t": ({"a": 1},)})) == {"x": [1, 2], "t": [{"a": 1}]}


def test_what_is_not_known_is_left_out() -> None:
    record = {"x": None, "y": 1, "t": [{"a": None, "b": 2}]}
    assert tomllib.loads(to_toml(record)) == {"y": 1, "t": [{"b": 2}]}


def test_people_can_read_it() -> None:
    text = to_toml(
        {"rms_px": 0.2, "radial": {"radius_px": 400.0}, "pictures": [{"file": "a"}, {"file": "b"}]}
    )
    assert text == (
        "rms_px = 0.2\n\n[radial]\nradius_px = 400.0\n\n"
        '[[pictures]]\nfile = "a"\n\n[[pictures]]\nfile = "b"\n'
    )


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (math.nan, "at.x of a record must be finite; got nan"),
        (-math.inf, "must be finite; got -inf"),
        ([1.0, [math.inf]], "must be finite"),
        ([1.0, None], "leave out what is not known"),
        (np.zeros(3), "got ndarray"),
        (b"raw", "got bytes"),
        ([1, {"a": 1}], "got dict"),
        ("\ud800", "UTF-8"),
        ({1: 2}, "keys of a record are texts"),
        ({"\udfff": 2}, "UTF-8"),
    ],
)
def test_what_toml_cannot_hold_is_refused(value: object, told: str) -> None:
    with pytest.raises(ContractError, match=told):
        to_toml({"at": {"x": value}})
