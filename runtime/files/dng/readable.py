"""Kinds of DNG: which LibRaw reads, which are read without it, and names of those that are not.

Numbers of compressions, layouts and colours: DNG specification 1.7.1, chapters 3 and 4; TIFF 6.0.
"""

from typing import Final

from camkit.cfa import CFA_PATTERNS
from camkit.errors import DecodeError
from camkit.runtime.files.dng.picture_tags import (
    LOSSY_JPEG,
    UNCOMPRESSED,
    DngPicture,
    first_of,
    numbers_of,
)
from camkit.runtime.files.dng.predictors import PIXELS_BACK

DEFLATE: Final = (8, 32946)
FLOAT_BITS: Final = (16, 24, 32)
WHOLE_BITS: Final = (8, 16)
MOST_WHOLE_BITS: Final = 16
BAYER: Final = (2, 2)
X_TRANS: Final = (6, 6)
_OF_LIBRAW: Final = (0, UNCOMPRESSED, 7, LOSSY_JPEG)
_COMPRESSIONS: Final = {
    2: "CCITT RLE", 3: "CCITT group 3", 4: "CCITT group 4", 5: "LZW", 6: "old JPEG", 9: "VC-5",
    32773: "PackBits", 34712: "JPEG 2000", 34925: "LZMA", 50000: "Zstandard", 50001: "WebP",
    50002: "JPEG XL", 52546: "JPEG XL",
}  # fmt: skip
_INTERLEAVED: Final = {
    50974: "SubTileBlockSize", 50975: "RowInterleaveFactor", 52547: "ColumnInterleaveFactor"
}  # fmt: skip
_CFA_LAYOUT: Final = 50711
_RECTANGULAR: Final = 1


def is_plain(picture: DngPicture) -> bool:
    """Return whether the samples of a picture are read without LibRaw."""
    plain_planar = picture.is_planar and picture.compression == UNCOMPRESSED
    return picture.is_float or picture.compression in DEFLATE or plain_planar


def check_readable(picture: DngPicture) -> None:
    """Refuse by its name what neither LibRaw nor `plain_samples` reads.

    Raises:
        DecodeError: If the samples are compressed, laid out or coloured so.
    """
    _check_compression(picture)
    _check_layout(picture)
    _check_colours(picture)
    _check_numbers(picture)


def _check_compression(picture: DngPicture) -> None:
    others = (UNCOMPRESSED,) if picture.is_float or picture.is_planar else _OF_LIBRAW
    if picture.compression in (*others, *DEFLATE):
        return
    name = _COMPRESSIONS.get(picture.compression, f"method {picture.compression}")
    if picture.is_planar and picture.compression in _OF_LIBRAW:
        raise DecodeError(
            f"the DNG has planes that lie apart, compressed ({name}), which is not read; save it "
            "with interleaved planes or uncompressed"
        )
    raise DecodeError(
        f"the DNG is compressed with {name}, which is not read; save it uncompressed or with "
        "lossless JPEG"
    )


def _check_layout(picture: DngPicture) -> None:
    for tag, name in _INTERLEAVED.items():
        values = numbers_of(picture.directory, tag)
        if values and max(values) > 1:
            raise DecodeError(
                f"the DNG interleaves its rows or columns ({name} {max(values):g}), which is not "
                "read; save it without"
            )
    layout = first_of(picture.directory, _CFA_LAYOUT, _RECTANGULAR)
    if layout != _RECTANGULAR and picture.pattern:
        raise DecodeError(
            f"the DNG has a sensor of staggered rows or columns (CFALayout {layout:g}), which is "
            "not read"
        )


def _check_colours(picture: DngPicture) -> None:
    """Refuse mosaics that are neither Bayer nor, for LibRaw, X-Trans, and odd numbers of planes."""
    letters, repeat = picture.pattern, picture.repeat
    if letters:
        is_stated = len(letters) == repeat[0] * repeat[1] > 0
        is_read = letters in CFA_PATTERNS if repeat == BAYER else repeat == X_TRANS
        if is_plain(picture):
            is_read = is_read and (*repeat, picture.planes) == (*BAYER, 1)
        if is_read or not (is_stated or is_plain(picture)):
            return
        text = "other colours" if "?" in letters else letters[:8]
        name = f"a CFA of {repeat[0]}x{repeat[1]} pixels ({text})"
    elif picture.planes in (1, 3):
        return
    else:
        name = f"{picture.planes} planes"
    raise DecodeError(f"the DNG holds {name}, which is not read: a Bayer cell is, and RGB")


def _check_numbers(picture: DngPicture) -> None:
    bits, predictor = picture.bits, int(first_of(picture.directory, 317, 1))
    kind = "floating-point" if picture.is_float else "whole"
    allowed = FLOAT_BITS if picture.is_float else WHOLE_BITS
    if bits not in allowed if is_plain(picture) else bits > MOST_WHOLE_BITS:
        raise DecodeError(f"the DNG holds {kind} samples of {bits} bits, which are not read")
    if picture.compression in DEFLATE and predictor not in PIXELS_BACK:
        raise DecodeError(f"the DNG is deflated with predictor {predictor}, which is not read")
