"""Refuse a DNG whose own tags contradict each other or what LibRaw made of them.

A flipped byte in the header often makes LibRaw skip a tag without a word: the black level becomes
0, the mosaic monochrome, the white level 65535. DNG states these things itself, so they can be
compared (DNG specification 1.7, chapter 4; tags of the directory that holds the sensor picture).
"""

import math
from itertools import pairwise
from typing import Final

import numpy as np

from camkit.cfa import CfaPattern
from camkit.errors import DecodeError
from camkit.runtime.files.dng.dng_levels import BLACK, BLACK_REPEAT, DELTA_H, DELTA_V, WHITE
from camkit.runtime.files.dng.masked_areas import MASKED_AREAS
from camkit.runtime.files.dng.opcodes import LISTS
from camkit.runtime.files.dng.picture_tags import (
    CFA,
    LOSSY_JPEG,
    UNCOMPRESSED,
    Directory,
    DngPicture,
    first_of,
    is_dng,
    numbers_of,
    sensor_picture,
)
from camkit.runtime.files.raw_checks import Levels, sensor_directories
from camkit.runtime.files.tiff_tags import TiffTags

LEVEL_TOLERANCE: Final = 1.0
ROW_PADDING_BYTES: Final = 16
MOST_BITS: Final = 64
TABLE_TOLERANCE: Final = 0.1

_BITS, _COMPRESSION, _SAMPLES, _SAMPLE_FORMAT = 258, 259, 277, 339
_WIDTH, _HEIGHT, _STRIP_BYTES, _PLANAR = 256, 257, 279, 284
_PHOTOMETRIC: Final = 262
_CHUNKS: Final = (("strip", 273, 0, 278), ("tile", 324, 322, 323))
_CROP_ORIGIN, _CROP_SIZE, _ACTIVE_AREA = 50719, 50720, 50829
_CURVES: Final = (50712, 51008, 51009)  # LinearizationTable, OpcodeList1, OpcodeList2
_CFA_REPEAT, _LINEARIZATION = 33421, 50712
_CELLS: Final = ((1, 1), (1, 2), (2, 1), (2, 2))


def check_dng(
    tags: TiffTags,
    cfa: CfaPattern | None,
    levels: Levels,
    overrides: frozenset[str] = frozenset(),
) -> None:
    """Compare a decode with the tags of its DNG; other files pass.

    Args:
        tags: The directories of the file.
        cfa: The pattern that LibRaw found; None for planes.
        levels: The levels that LibRaw found.
        overrides: Levels ("black", "white") that the caller states; the file's do not matter.

    Raises:
        DecodeError: If they contradict each other.
    """
    if not is_dng(tags):
        return
    sensor = sensor_picture(tags)
    if sensor is None:
        raise DecodeError("the DNG holds no sensor picture (CFA or LinearRaw); header damaged?")
    check_layout(sensor)
    picture = sensor.directory
    if numbers_of(picture, _CFA_REPEAT) == (2, 2) and cfa is None:
        raise DecodeError("the DNG states a 2x2 CFA, LibRaw found none; its header is damaged")
    if "black" not in overrides:
        _check_black(picture, levels)
    if "white" not in overrides:
        _check_white(picture, levels)


def states_cells(tags: TiffTags) -> bool:
    """Return whether a sensor picture of any file is stated to be a mosaic of 2x2 cells."""
    return any(
        picture.get(_PHOTOMETRIC) == (CFA,) and numbers_of(picture, _CFA_REPEAT) == (2, 2)
        for picture in sensor_directories(tags.directories)
    )


def unapplied(picture: DngPicture) -> list[str]:
    """Return notes on tags that are left out where LibRaw demosaics a picture."""
    names = {DELTA_V: "BlackLevelDeltaV", DELTA_H: "BlackLevelDeltaH"} | LISTS
    ignored = [name for tag, name in names.items() if tag in picture.directory]
    return (
        [f"not applied, since LibRaw demosaicked the file: {', '.join(ignored)}"] if ignored else []
    )


def find_doubts(tags: TiffTags) -> list[str]:
    """Return the contradictions in the sensor picture of a DNG, and the parts without data."""
    directories = [d for d in sensor_directories(tags.directories) if numbers_of(d, _WIDTH)]
    doubts = [
        "the header does not say where the pixels of the mosaic lie"
        for picture in directories
        if picture.get(_PHOTOMETRIC) == (CFA,) and not any(t in picture for _, t, *_ in _CHUNKS)
    ]
    doubts += [_depth_doubt(picture) for picture in directories]
    if not is_dng(tags):
        directories = []
    for picture in directories:
        doubts += [_chunk_doubt(picture), _area_doubt(picture), _curve_doubt(picture)]
        doubts.append(_table_doubt(picture))
    return [f"{doubt}: the header is damaged" for doubt in doubts if doubt]


def _chunk_doubt(picture: Directory) -> str:
    """Compare the number of strips or tiles with the size (TIFF 6.0, sections 3 and 15)."""
    width, height = first_of(picture, _WIDTH), first_of(picture, _HEIGHT)
    groups = int(first_of(picture, _SAMPLES, 1)) if first_of(picture, _PLANAR, 1) == 2 else 1
    for noun, offsets_tag, wide_tag, high_tag in _CHUNKS:
        count = len(numbers_of(picture, offsets_tag))
        wide, high = first_of(picture, wide_tag, width), first_of(picture, high_tag, height)
        if not count:
            continue
        if min(wide, high) < 1:
            return f"a {noun} of {wide:.0f}x{high:.0f} pixels holds nothing"
        expected = math.ceil(width / wide) * math.ceil(height / high) * groups
        if count != expected:
            return f"{width:.0f}x{height:.0f} pixels need {expected} {noun}(s), there are {count}"
    byte_count = sum(numbers_of(picture, _STRIP_BYTES))
    if first_of(picture, _COMPRESSION) == UNCOMPRESSED and height and byte_count:
        rest = byte_count % height
        if min(rest, height - rest) > ROW_PADDING_BYTES:
            return (
                f"{byte_count:.0f} bytes of pixels are no whole number for each of {height:.0f} "
                "rows"
            )
    return ""


def _curve_doubt(picture: Directory) -> str:
    """Check that 8 bits of lossy JPEG come with the curve that makes light of them."""
    lossy = first_of(picture, _COMPRESSION) == LOSSY_JPEG
    return "" if not lossy or any(tag in picture for tag in _CURVES) else "its curve is missing"


def _depth_doubt(picture: Directory) -> str:
    """Check that the bits of a mosaic hold its white; 8 may stand for more behind a curve."""
    bits, white = first_of(picture, _BITS), first_of(picture, WHITE)
    mosaic = picture.get(_PHOTOMETRIC) == (CFA,) and _LINEARIZATION not in picture
    if (
        mosaic
        and 8 < bits <= MOST_BITS
        and white >= 2**bits
        and first_of(picture, _SAMPLE_FORMAT, 1) == 1
    ):
        return f"white {white:g} does not fit in {bits:.0f} bits"
    return ""


def _table_doubt(picture: Directory) -> str:
    """Compare white with the end of the table that makes light of the stored numbers."""
    table, white = numbers_of(picture, _LINEARIZATION), first_of(picture, WHITE)
    if any(after < before for before, after in pairwise(table)):
        return "the table that makes light of the samples falls"
    if not table or not white or abs(max(table) / white - 1) <= TABLE_TOLERANCE:
        return ""
    return f"white is {white:g}, the table of the samples ends at {max(table):g}"


def _area_doubt(picture: Directory) -> str:
    """Check that the active area lies in the picture and the crop in the active area."""
    width, height = first_of(picture, _WIDTH), first_of(picture, _HEIGHT)
    samples = first_of(picture, _SAMPLES, 1)
    if picture.get(_CFA_REPEAT) and samples != 1:
        return f"a mosaic has one sample in each pixel, not {samples:.0f}"
    area = numbers_of(picture, _ACTIVE_AREA)
    if len(area) == 4:
        top, left, bottom, right = area
        if not (0 <= top < bottom <= height and 0 <= left < right <= width):
            return f"the active area {area} leaves the {width:.0f}x{height:.0f} pixels"
        width, height = right - left, bottom - top
    origin, size = numbers_of(picture, _CROP_ORIGIN) or (0.0, 0.0), numbers_of(picture, _CROP_SIZE)
    if len(origin) != 2 or len(size) != 2:
        return ""
    if min(size) < 1 or origin[0] + size[0] > width or origin[1] + size[1] > height:
        return f"the crop {size} at {origin} leaves the {width:.0f}x{height:.0f} pixels"
    return ""


def check_layout(sensor: DngPicture) -> None:
    """Compare the strips of an uncompressed picture with its size.

    Raises:
        DecodeError: If they hold another number of bytes.
    """
    picture = sensor.directory
    byte_count = sum(numbers_of(picture, _STRIP_BYTES))
    if first_of(picture, _COMPRESSION) != UNCOMPRESSED or not byte_count:
        return
    rows = first_of(picture, _HEIGHT)
    row_bits = first_of(picture, _WIDTH) * first_of(picture, _SAMPLES, 1) * first_of(picture, _BITS)
    expected = rows * row_bits / 8
    if not expected - ROW_PADDING_BYTES <= byte_count <= expected + rows * ROW_PADDING_BYTES:
        raise DecodeError(
            f"the DNG states {byte_count:.0f} bytes of uncompressed pixels, its size and depth "
            f"need {expected:.0f}; its header is damaged"
        )


def _check_black(picture: Directory, levels: Levels) -> None:
    blacks = numbers_of(picture, BLACK)
    if not blacks and BLACK_REPEAT in picture:
        raise DecodeError("the DNG lays out black levels but gives none; its header is damaged")
    # LibRaw has means of deltas and masked areas, and a corner of large patterns
    if not blacks or any(tag in picture for tag in (DELTA_H, DELTA_V, MASKED_AREAS)):
        return
    if (numbers_of(picture, BLACK_REPEAT) or (1, 1)) not in _CELLS:
        return
    decoded, mean = float(np.mean(levels.black)), sum(blacks) / len(blacks)
    if not abs(mean - decoded) <= LEVEL_TOLERANCE:
        raise DecodeError(
            f"the DNG states black {mean:g}, LibRaw found {decoded:g}; its header is damaged"
        )


def _check_white(picture: Directory, levels: Levels) -> None:
    bits = first_of(picture, _BITS)
    rescaled = bits <= 8 or first_of(picture, _COMPRESSION) == LOSSY_JPEG
    if rescaled or first_of(picture, _SAMPLE_FORMAT, 1) != 1:
        return
    whites = numbers_of(picture, WHITE)
    # LibRaw moves white by what the blacks of planes differ
    if len(set(numbers_of(picture, BLACK))) > 1 and picture.get(_PHOTOMETRIC) != (CFA,):
        return
    if whites and abs(max(whites) - levels.white) > LEVEL_TOLERANCE:
        raise DecodeError(
            f"the DNG states white {max(whites):g}, LibRaw found {levels.white:g}; "
            "its header is damaged"
        )
    if not numbers_of(picture, _LINEARIZATION) and levels.white > 2.0 ** min(bits, MOST_BITS) - 1:
        raise DecodeError(
            f"white level {levels.white:g} does not fit in the {bits:.0f} bits of the DNG; "
            "its header is damaged"
        )
