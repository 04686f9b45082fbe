import codecs

import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.errors import DecodeError
from camkit.models_def.optics.glass.encoding import MAX_BYTES, decode_text, read_text

TEXT = "NAME lens Ø50 mm\nSURF 0\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16", "utf-16-le"])
def test_usual_encodings_give_the_same_text(encoding: str) -> None:
    assert decode_text(TEXT.encode(encoding), "x") == TEXT


def test_big_endian_text_is_read_with_and_without_mark() -> None:
    data = TEXT.encode("utf-16-be")
    assert decode_text(codecs.BOM_UTF16_BE + data, "x") == TEXT
    assert decode_text(data, "x") == TEXT


@given(data=st.binary(max_size=300))
def test_any_bytes_give_text_or_a_decode_error(data: bytes) -> None:
    try:
        text = decode_text(data, "x")
    except DecodeError:
        return
    assert "\0" not in text


def test_huge_file_is_refused_before_it_is_read(tmp_path) -> None:
    path = tmp_path / "huge.agf"
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(DecodeError, match="at most"):
        read_text(path)
