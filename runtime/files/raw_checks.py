"""Refuse a decode that cannot be true. LibRaw returns black or stale pixels without an error.

    before the decode: strips and tiles lie inside the file, the size is one that fits the file
    after it:          levels, pattern, something in the picture, no rows that were never read

Pure functions: numbers and arrays in, `DecodeError` or nothing out. A night photograph passes:
its black areas carry read noise around the black level, which unread memory does not.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.cfa import CFA_PATTERNS, CfaPattern
from camkit.errors import DecodeError
from camkit.runtime.files.tiff_tags import TagValue, TiffTags
from camkit.runtime.machine.memory import release_pages

MAX_PIXELS: Final = 1_000_000_000
MAX_PIXELS_PER_BYTE: Final = 256
MIN_SIDE_PX: Final = 2
OVER_WHITE_SHARE: Final = 0.05
_BAND_ROWS: Final = 64
OVER_WHITE_FACTOR: Final = 1.1
ZERO_SHARE: Final = 0.02
LIVE_SIGNAL: Final = 0.02

_WIDTH: Final = 256
_HEIGHT: Final = 257
_PHOTOMETRIC: Final = 262
_SENSOR_PHOTOMETRICS: Final = (32803, 34892)  # DNG 1.7: CFA, LinearRaw
_CHUNKS: Final = ((273, 279, "strip"), (324, 325, "tile"))

Samples = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """Levels that the checks need, in file units."""

    black: FloatArray
    white: float


def check_chunks_inside(tags: TiffTags) -> None:
    """Refuse a file whose pixel strips or tiles reach beyond its end or over its header.

    Raises:
        DecodeError: If a sensor picture (CFA or LinearRaw, else the largest) is cut off, or its
            data cannot lie where the header says.
    """
    for directory in sensor_directories(tags.directories):
        for offsets_tag, lengths_tag, noun in _CHUNKS:
            offsets, lengths = directory.get(offsets_tag), directory.get(lengths_tag)
            if (
                not offsets
                or not lengths
                or isinstance(offsets, bytes)
                or isinstance(lengths, bytes)
            ):
                continue
            if len(offsets) != len(lengths):
                raise DecodeError(
                    f"the file lists {len(offsets)} {noun} offsets but {len(lengths)} lengths; "
                    "its header is damaged, copy it again from the camera"
                )
            spans = [(o, o + n) for o, n in zip(offsets, lengths, strict=True)]
            if any(first <= at < end for first, end in spans for at in (0, *tags.starts)):
                raise DecodeError(
                    "the pixel data begin before the header ends; it is damaged, copy the file "
                    "again from the camera"
                )
            end = max(end for _, end in spans)
            if end > tags.file_bytes:
                raise DecodeError(
                    f"pixel data should reach byte {end:.0f}, the file ends at {tags.file_bytes}; "
                    "it is cut off, copy it again from the camera"
                )


def sensor_directories(
    directories: tuple[Mapping[int, TagValue], ...],
) -> list[Mapping[int, TagValue]]:
    """Return the directories that hold a sensor picture: CFA or LinearRaw, else the largest."""

    def first(directory: Mapping[int, TagValue], tag: int) -> float:
        value = directory.get(tag)
        return value[0] if value and not isinstance(value, bytes) else 0

    sensor = [d for d in directories if first(d, _PHOTOMETRIC) in _SENSOR_PHOTOMETRICS]
    if sensor or not directories:
        return sensor
    return [max(directories, key=lambda d: first(d, _WIDTH) * first(d, _HEIGHT))]


def check_size(height: int, width: int, file_bytes: int) -> None:
    """Refuse sizes that no camera makes or that the file cannot hold.

    Raises:
        DecodeError: If the picture is too small, too large, or larger than the file allows.
    """
    pixels = height * width
    if height < MIN_SIDE_PX or width < MIN_SIDE_PX:
        raise DecodeError(f"picture size {width}x{height} is not believable; the header is damaged")
    if pixels > MAX_PIXELS or pixels > file_bytes * MAX_PIXELS_PER_BYTE:
        raise DecodeError(
            f"the header claims {width}x{height} pixels in {file_bytes} bytes; at most "
            f"{MAX_PIXELS} pixels and {MAX_PIXELS_PER_BYTE} per byte are believable"
        )


def check_pattern(letters: str) -> CfaPattern:
    """Return the CFA letters as a pattern.

    Raises:
        DecodeError: If they are not a Bayer cell.
    """
    for cfa in CFA_PATTERNS:
        if letters == cfa:
            return cfa
    raise DecodeError(f"CFA {letters!r} is not one of {', '.join(CFA_PATTERNS)}; header damaged?")


def check_levels(levels: Levels, largest_possible: float = 65535) -> None:
    """Refuse levels that are not ordered black < white <= the largest stored value.

    Raises:
        DecodeError: If they are not.
    """
    black = levels.black
    if (
        not np.isfinite(black).all()
        or (black < 0).any()
        or not 0 < levels.white <= largest_possible
    ):
        raise DecodeError(
            f"levels are not believable: black {black.tolist()}, white {levels.white}"
        )
    if black.max() >= levels.white:
        raise DecodeError(f"white level {levels.white:g} must lie above black {black.max():g}")


def check_content(samples: Samples, levels: Levels) -> None:
    """Refuse samples that no exposure gives: constant, unread, or outside the levels.

    Args:
        samples: (h, w) mosaic or (channel, h, w) planes, unsigned integers.
        levels: Black and white level of the same file.

    Raises:
        DecodeError: If the picture is constant, ends in rows that were never read, or lies mostly
            above the white or wholly below the black level.
    """
    low, high = int(samples.min()), int(samples.max())
    if low == high:
        raise DecodeError(f"every pixel is {low}: the pixel data are missing or were not decoded")
    if high <= levels.black.min():
        raise DecodeError(
            f"no pixel exceeds the black level {levels.black.min():g} (largest is {high}); "
            "the black level or the pixel data are damaged"
        )
    share = share_over_white(samples, levels.white) if high > levels.white else 0.0
    if share > OVER_WHITE_SHARE:
        raise DecodeError(
            f"{share:.0%} of the pixels lie above the white level {levels.white:g}; "
            f"the white level or the pixel data are damaged "
            f"(set it with {option_text('white_level')})"
        )
    if low == 0:
        _check_unread(samples, levels)


def share_over_white(samples: Samples, white: float) -> float:
    """Return the share of samples clearly above white, in bands that stay in cache."""
    rows = samples.shape[-2]
    limit = white * OVER_WHITE_FACTOR
    bands = (samples[..., top : top + _BAND_ROWS, :] for top in range(0, rows, _BAND_ROWS))
    count = sum(int(np.count_nonzero(band > limit)) for band in bands)
    release_pages(samples)
    return count / samples.size


def _check_unread(samples: Samples, levels: Levels) -> None:
    """Check for zeros that LibRaw left where the file ended."""
    live_rows = np.asarray(samples.reshape(-1, *samples.shape[-2:]).any(axis=(0, 2)))
    tail = int(np.argmax(live_rows[::-1]))
    if levels.black.min() > 0:
        share = float(np.mean(samples == 0))
        if tail >= 2 or share > ZERO_SHARE:
            raise DecodeError(
                f"{share:.1%} of the pixels are 0 although black is {levels.black.min():g}, "
                f"{tail} rows at the end: the pixel data are incomplete"
            )
    elif tail >= 2:
        # black at 0 lets a dark foreground be 0; a cut shows as a bright row before the zeros
        last_rows = samples[..., -tail - 3 : -tail - 1, :]
        if last_rows.size and float(np.median(last_rows)) > LIVE_SIGNAL * levels.white:
            raise DecodeError(
                f"the last {tail} rows are 0 after a bright row: the data are cut off"
            )
