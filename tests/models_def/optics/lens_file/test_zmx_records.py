import time

import pytest

from camkit.errors import DecodeError
from camkit.models_def.optics.lens_file.zmx_records import last, parse_records
from tests.zmx_factory import LA1131


def test_lines_after_the_surfaces_belong_to_the_system() -> None:
    records = parse_records(LA1131)
    assert len(records.surfaces) == 4
    assert "MNUM" in records.system
    assert "MNUM" not in records.surfaces[-1]


def test_a_later_line_replaces_an_earlier_one() -> None:
    records = parse_records(LA1131 + "ENPD 3\n")
    record = last(records.system, "ENPD")
    assert record is not None
    assert record.number(0) == 3
    assert last(records.system, "NONE") is None


def test_a_million_surfaces_are_refused_at_once() -> None:
    text = "".join(f"SURF {i}\n" for i in range(1_000_000))
    start = time.process_time()
    with pytest.raises(DecodeError, match="line 1001: more than 1000 surfaces"):
        parse_records(text)
    assert time.process_time() - start < 3


@pytest.mark.parametrize("text", ["", "\n\n", "not a lens", "SURF 0\nSURF 1\n", "PK\x03\x04 \x01"])
def test_file_without_surfaces_is_refused(text: str) -> None:
    with pytest.raises(DecodeError, match="SURF"):
        parse_records(text)
