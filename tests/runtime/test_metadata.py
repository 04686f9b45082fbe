import math
from dataclasses import fields

import pytest

from camkit.errors import ContractError
from camkit.runtime.metadata import MAX_TEXT, Metadata, clean_text


def test_foreign_text_is_bounded_and_prints() -> None:
    text = clean_text("\x1b[31mCan\u202eon\0\n" + "x" * 10_000)
    assert text.startswith("[31mCan on x")
    assert len(text) <= MAX_TEXT
    assert text.isprintable()
    assert clean_text(b"bytes") == clean_text(None) == clean_text("\0\x07") == ""


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("iso", math.nan),
        ("iso", math.inf),
        ("iso", 0),
        ("iso", True),
        ("iso", "100"),
        ("exposure_time_s", -1.0),
        ("f_number", 1e9),
        ("captured_at", "2024:13:01 00:00:00"),
        ("captured_at", "2024:02:30 00:00:00"),
        ("captured_at", "    :  :     :  :  "),
        ("utc_offset", "+99:00"),
        ("make", 7),
    ],
)
def test_what_is_not_believable_counts_as_not_stated(name: str, value: object) -> None:
    assert Metadata.believable(**{name: value}) == Metadata()


def test_dates_are_brought_to_one_form() -> None:
    for text in ("2024:05:06 07:08:09", "2024-05-06T07:08:09", "2024/05/06 07:08:09.25"):
        assert Metadata.believable(captured_at=text).captured_at == "2024:05:06 07:08:09"


def test_half_a_place_is_none() -> None:
    assert Metadata.believable(latitude_deg=48.0, altitude_m=3.0) == Metadata()
    assert Metadata.believable(latitude_deg=48.0, longitude_deg=181.0) == Metadata()
    found = Metadata.believable(latitude_deg=0.0, longitude_deg=-0.5)
    assert (found.latitude_deg, found.longitude_deg) == (0.0, -0.5)
    with pytest.raises(ContractError, match="place"):
        Metadata(latitude_deg=1.0)


@pytest.mark.parametrize(
    "change", [{"make": "a\nb"}, {"make": 3}, {"iso": -1.0}, {"captured_at": "yesterday"}]
)
def test_only_clean_values_are_taken_as_they_are(change: dict[str, object]) -> None:
    with pytest.raises(ContractError, match=next(iter(change))):
        Metadata(**change)  # type: ignore[arg-type]


def test_what_is_stated_is_not_replaced() -> None:
    known = Metadata(make="Canon", iso=100.0)
    found = known.completed(make="Nikon", iso=None, f_number=4.0, model="\0")
    assert found == Metadata(make="Canon", iso=100.0, f_number=4.0)
    assert found.to_json() == {"make": "Canon", "iso": 100.0, "f_number": 4.0}


def test_camera_does_not_repeat_its_maker() -> None:
    assert Metadata(make="Canon", model="Canon EOS 6D").camera == "Canon EOS 6D"
    assert Metadata(make="SONY", model="ILCE-7RM3").camera == "SONY ILCE-7RM3"
    assert Metadata().camera == ""


def test_every_field_has_a_way_to_say_nothing() -> None:
    assert {f.default for f in fields(Metadata)} == {"", None}
