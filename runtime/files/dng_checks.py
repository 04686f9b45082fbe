"""Refuse a DNG whose own tags contradict each other or what LibRaw made of them.

A flipped byte in the header often makes LibRaw skip a tag without a word: the black level becomes
0, the mosaic monochrome, the white level 65535. DNG states these things itself, so they can be
compared (DNG specification 1.7, chapter 4; tags of the directory that holds the sensor picture).
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from camkit.contracts import CfaPattern
from camkit.errors import DecodeError
from camkit.runtime.files.raw_checks import Levels, sensor_directories
from camkit.runtime.files.tiff_tags import TagValue, TiffTags

DNG_VERSION: Final = 50706
UNCOMPRESSED: Final = 1
LOSSY_JPEG: Final = 34892
LEVEL_TOLERANCE: Final = 1.0
ROW_PADDING_BYTES: Final = 16

_BITS, _COMPRESSION, _SAMPLES, _SAMPLE_FORMAT = 258, 259, 277, 339
_WIDTH, _HEIGHT, _STRIP_BYTES = 256, 257, 279
_CFA_REPEAT, _LINEARIZATION = 33421, 50712
_BLACK_REPEAT, _BLACK, _BLACK_DELTAS, _WHITE = 50713, 50714, (50715, 50716), 50717
_WHITE_BALANCES: Final = (50728, 50729)  # AsShotNeutral, AsShotWhiteXY

Directory = Mapping[int, TagValue]


def is_dng(tags: TiffTags) -> bool:
    """Tell whether any directory carries DNGVersion."""
    return any(DNG_VERSION in directory for directory in tags.directories)


def states_white_balance(tags: TiffTags) -> bool:
    """Tell whether a DNG states its white balance (LibRaw answers 1, 1, 1 if not)."""
    return any(tags.numbers(tag) is not None for tag in _WHITE_BALANCES)


def is_float(tags: TiffTags) -> bool:
    """Tell whether the sensor picture of a DNG holds floating-point samples."""
    return is_dng(tags) and any(
        _first(directory, _SAMPLE_FORMAT, 1) == 3
        for directory in sensor_directories(tags.directories)
    )


def check_dng(tags: TiffTags, cfa: CfaPattern | None, levels: Levels) -> None:
    """Compare a decode with the tags of its DNG; other files pass.

    Args:
        tags: The directories of the file.
        cfa: The pattern that LibRaw found; None for planes.
        levels: The levels that LibRaw found.

    Raises:
        DecodeError: If they contradict each other.
    """
    if not is_dng(tags):
        return
    directories = [d for d in sensor_directories(tags.directories) if _numbers(d, _WIDTH)]
    if not directories:
        raise DecodeError("the DNG holds no sensor picture (CFA or LinearRaw); header damaged?")
    picture = max(directories, key=lambda d: _first(d, _WIDTH) * _first(d, _HEIGHT))
    _check_strip_bytes(picture)
    if _numbers(picture, _CFA_REPEAT) == (2, 2) and cfa is None:
        raise DecodeError("the DNG states a 2x2 CFA, LibRaw found none; its header is damaged")
    _check_black(picture, levels)
    _check_white(picture, levels)


def _numbers(directory: Directory, tag: int) -> tuple[float, ...]:
    value = directory.get(tag)
    return () if value is None or isinstance(value, bytes) else value


def _first(directory: Directory, tag: int, default: float = 0.0) -> float:
    return next(iter(_numbers(directory, tag)), default)


def _check_strip_bytes(picture: Directory) -> None:
    """Compare the strips of an uncompressed picture with its size."""
    stated = sum(_numbers(picture, _STRIP_BYTES))
    if _first(picture, _COMPRESSION) != UNCOMPRESSED or not stated:
        return
    rows = _first(picture, _HEIGHT)
    row_bits = _first(picture, _WIDTH) * _first(picture, _SAMPLES, 1) * _first(picture, _BITS)
    expected = rows * row_bits / 8
    if not expected - ROW_PADDING_BYTES <= stated <= expected + rows * ROW_PADDING_BYTES:
        raise DecodeError(
            f"the DNG states {stated:.0f} bytes of uncompressed pixels, its size and depth need "
            f"{expected:.0f}; its header is damaged"
        )


def _check_black(picture: Directory, levels: Levels) -> None:
    stated = _numbers(picture, _BLACK)
    if not stated and _BLACK_REPEAT in picture:
        raise DecodeError("the DNG lays out black levels but gives none; its header is damaged")
    if not stated or any(tag in picture for tag in _BLACK_DELTAS):
        return
    found = float(np.mean(levels.black))
    if not abs(float(np.mean(stated)) - found) <= LEVEL_TOLERANCE:
        raise DecodeError(
            f"the DNG states black {np.mean(stated):g}, LibRaw found {found:g}; "
            "its header is damaged"
        )


def _check_white(picture: Directory, levels: Levels) -> None:
    bits = _first(picture, _BITS)
    rescaled = bits <= 8 or _first(picture, _COMPRESSION) == LOSSY_JPEG
    if rescaled or _first(picture, _SAMPLE_FORMAT, 1) != 1:
        return
    stated = _numbers(picture, _WHITE)
    if stated and abs(max(stated) - levels.white) > LEVEL_TOLERANCE:
        raise DecodeError(
            f"the DNG states white {max(stated):g}, LibRaw found {levels.white:g}; "
            "its header is damaged"
        )
    if not _numbers(picture, _LINEARIZATION) and levels.white > 2**bits - 1:
        raise DecodeError(
            f"white level {levels.white:g} does not fit in the {bits:.0f} bits of the DNG; "
            "its header is damaged"
        )
