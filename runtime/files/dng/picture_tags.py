"""The directory of a DNG that holds the sensor picture, as typed values.

Tag numbers and defaults: DNG specification 1.7.1, chapters 2 to 4; TIFF 6.0.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from camkit.runtime.files.raw_checks import sensor_directories
from camkit.runtime.files.tiff_tags import TagValue, TiffTags

DNG_VERSION: Final = 50706
CFA: Final = 32803
FLOAT_FORMAT: Final = 3
UNCOMPRESSED: Final = 1
LOSSY_JPEG: Final = 34892
_COLOURS: Final = "RGB"

Directory = Mapping[int, TagValue]
Rectangle = tuple[int, int, int, int]
"""Top, left, bottom, right."""


def numbers_of(directory: Directory, tag: int) -> tuple[float, ...]:
    """Return the numbers of a tag; none if it is absent or text."""
    value = directory.get(tag)
    return () if value is None or isinstance(value, bytes) else value


def first_of(directory: Directory, tag: int, default: float = 0.0) -> float:
    """Return the first number of a tag, or the default if there is none that is finite."""
    value = next(iter(numbers_of(directory, tag)), default)
    return value if math.isfinite(value) else default


def whole_of(directory: Directory, tag: int) -> tuple[int, ...]:
    """Return the numbers of a tag as whole ones; none if one of them is no number."""
    values = numbers_of(directory, tag)
    return tuple(int(n) for n in values) if all(math.isfinite(n) for n in values) else ()


def octets_of(directory: Directory, tag: int) -> bytes:
    """Return the bytes of an opaque tag, which some programs store as numbers."""
    value = directory.get(tag, b"")
    if isinstance(value, bytes):
        return value
    return bytes(int(n) for n in value) if all(0 <= n <= 255 for n in value) else b""


def is_dng(tags: TiffTags) -> bool:
    """Return whether any directory carries DNGVersion."""
    return any(DNG_VERSION in directory for directory in tags.directories)


@dataclass(frozen=True, slots=True, kw_only=True)
class DngPicture:
    """The sensor picture of a DNG.

    Attributes:
        directory: Its tags.
        width: Columns of the whole stored picture.
        height: Rows of it.
        planes: Samples of a pixel.
    """

    directory: Directory
    width: int
    height: int
    planes: int

    @property
    def bits(self) -> int:
        """Return the bits of a sample."""
        return int(first_of(self.directory, 258, 1))

    @property
    def compression(self) -> int:
        """Return the number of the compression (TIFF tag 259)."""
        return int(first_of(self.directory, 259, 1))

    @property
    def is_float(self) -> bool:
        """Return whether samples are floating-point numbers."""
        return first_of(self.directory, 339, 1) == FLOAT_FORMAT

    @property
    def is_planar(self) -> bool:
        """Return whether each sample of a pixel lies in a plane of its own."""
        return first_of(self.directory, 284, 1) == 2 and self.planes > 1

    @property
    def is_rescaled(self) -> bool:
        """Return whether LibRaw turns the samples into others, whose levels only it knows."""
        return self.compression == LOSSY_JPEG or (self.bits <= 8 and not self.is_float)

    @property
    def tile_size(self) -> tuple[int, int] | None:
        """Return height and width of the tiles; None for strips."""
        tall, wide = int(first_of(self.directory, 323)), int(first_of(self.directory, 322))
        return (tall, wide) if min(tall, wide) > 0 else None

    @property
    def active_area(self) -> Rectangle:
        """Return the ActiveArea, or the whole picture where there is none that can be."""
        area = whole_of(self.directory, 50829)
        if len(area) == 4:
            top, left, bottom, right = area
            if 0 <= top < bottom <= self.height and 0 <= left < right <= self.width:
                return top, left, bottom, right
        return 0, 0, self.height, self.width

    @property
    def pattern(self) -> str:
        """Return the letters of the CFA at the first active pixel; empty for planes."""
        if first_of(self.directory, 262) != CFA:
            return ""
        colours = octets_of(self.directory, 50710) or bytes((0, 1, 2))
        cell = octets_of(self.directory, 33422)
        is_rgb = all(n < len(_COLOURS) for n in cell) and colours == bytes((0, 1, 2))
        return "".join(_COLOURS[n] for n in cell) if is_rgb else "?" * len(cell)

    @property
    def repeat(self) -> tuple[int, int]:
        """Return rows and columns of the cell of the CFA."""
        size = whole_of(self.directory, 33421)
        return (size[0], size[1]) if len(size) == 2 else (0, 0)


def sensor_picture(tags: TiffTags) -> DngPicture | None:
    """Return the sensor picture of a DNG: the full-size one, else the largest; None without one."""
    if not is_dng(tags):
        return None
    directories = [d for d in sensor_directories(tags.directories) if numbers_of(d, 256)]
    if not directories:
        return None
    # an enhanced copy (NewSubfileType 16) may be larger than the picture itself
    main = max(
        directories, key=lambda d: (first_of(d, 254) == 0, first_of(d, 256) * first_of(d, 257))
    )
    return DngPicture(
        directory=main,
        width=int(first_of(main, 256)),
        height=int(first_of(main, 257)),
        planes=int(first_of(main, 277, 1)),
    )
