"""Headers of Radiance HDR files: what is read, and what is refused before it is decoded."""

import pytest

from camkit.errors import DecodeError
from camkit.runtime.files.formats.radiance import check_header

HEADER = b"#?RADIANCE\nSOFTWARE=a\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n"
SAMPLES = bytes(64)


def test_a_plain_header_is_taken() -> None:
    check_header(HEADER + SAMPLES)
    check_header(HEADER.replace(b"RADIANCE", b"RGBE") + bytes(1))  # sixteen pixels in one byte


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (HEADER.replace(b"\n\n", b"\n"), "no end of its header"),
        (HEADER.replace(b"\n", b"\r\n"), "no end of its header"),
        (b"#?RADIANCE\n" + b"a" * 70_000 + HEADER, "no end of its header"),
        (HEADER.replace(b"rgbe", b"xyze"), "FORMAT=32-bit_rle_rgbe; got 32-bit_rle_xyze"),
        (HEADER.replace(b"FORMAT", b"FROM"), "got none"),
        (HEADER.replace(b"-Y", b"+Y"), "'-Y HEIGHT \\+X WIDTH'"),
        (HEADER.replace(b"+X 8", b"+X 9999999"), "'-Y HEIGHT"),
        (HEADER.replace(b"+X 8", b"+X 60000") + SAMPLES, "60000x2 pixels"),
        (HEADER.replace(b"+X 8", b"+X 0") + SAMPLES, "0x2 pixels"),
        (HEADER, "8x2 pixels"),
    ],
)
def test_a_header_that_cannot_be_followed_is_refused(data: bytes, words: str) -> None:
    with pytest.raises(DecodeError, match=words):
        check_header(data)
