"""The metadata of a photograph as EXIF: the block of PNG and JPEG, the directories of TIFF and DNG.

Pictures of camkit stand upright, so their orientation is 1; only a DNG says how to turn it.
Reference: Exif 2.32 (CIPA DC-008), 4.6.
"""

from fractions import Fraction
from typing import Final

from camkit.runtime.files import exif_tags
from camkit.runtime.files.tiff_tags import EXIF_POINTER, GPS_POINTER
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.directory import (
    Kind,
    Tags,
    directory_bytes,
    directory_length,
    header_bytes,
)
from camkit.runtime.output.picture_writer import UPRIGHT, PictureFormat

EXIF_VERSION: Final = b"0232"
GPS_VERSION: Final = bytes((2, 3, 0, 0))
NOTHING: Final[Tags] = {}
MAX_SHORT: Final = 65535
_IN_MAIN: Final = ("make", "model", "artist", "copyright")
_IN_EXIF: Final = ("lens_make", "lens_model", "captured_at", "utc_offset")
_NUMBERS: Final = ("exposure_time_s", "f_number", "focal_length_mm")
_EXIF_VERSION, _GPS_VERSION, _SENSITIVITY_TYPE = 36864, 0, 34864
_SECONDS_PARTS: Final = 10_000


def exif_block(metadata: Metadata, *, main: Tags, exif: Tags) -> bytes:
    """Return EXIF as a TIFF structure of its own.

    Args:
        metadata: What is carried.
        main: What else the first directory holds.
        exif: What else is said beside the exposure.

    Returns:
        The structure; empty where no metadata are stated.
    """
    if not metadata.stated():
        return b""
    start = len(header_bytes(0))
    main = {**main, **main_tags(metadata), exif_tags.ORIENTATION: (Kind.SHORT, UPRIGHT)}
    pointers, _ = sub_directories(metadata, 0, exif=exif)
    end = start + directory_length({**main, **pointers})
    pointers, below = sub_directories(metadata, end, exif=exif)
    return header_bytes(start) + directory_bytes({**main, **pointers}, start) + below


def color_tags(picture: PictureFormat) -> Tags:
    """Return whether a picture is sRGB, for those who do not read its profile."""
    is_srgb = picture.color.space == "rec709" and picture.tone == "srgb"
    return {
        40960: (Kind.UNDEFINED, b"0100"),  # FlashpixVersion
        40961: (Kind.SHORT, 1 if is_srgb else 65535),  # ColorSpace: sRGB, or uncalibrated
    }


def main_tags(metadata: Metadata) -> Tags:
    """Return the tags of the first directory of a file."""
    return _texts(metadata, _IN_MAIN)


def sub_directories(
    metadata: Metadata, offset: int, *, exif: Tags = NOTHING, big: bool = False
) -> tuple[Tags, bytes]:
    """Return the directories for exposure and place.

    Args:
        metadata: What is carried.
        offset: Where they lie in the file.
        exif: What else is said beside the exposure.
        big: BigTIFF.

    Returns:
        The tags of the first directory that point at them, and their bytes; none of either where
        no metadata are stated.
    """
    pointers: dict[int, tuple[Kind, int]] = {}
    found = b""
    more = exif if metadata.stated() else NOTHING
    for pointer, tags in ((EXIF_POINTER, _exif(metadata, more)), (GPS_POINTER, _gps(metadata))):
        if tags:
            pointers[pointer] = Kind.LONG8 if big else Kind.LONG, offset + len(found)
            found += directory_bytes(tags, offset + len(found), big=big)
    return pointers, found


def _texts(metadata: Metadata, names: tuple[str, ...]) -> Tags:
    told = ((exif_tags.TEXT_TAGS[name], getattr(metadata, name)) for name in names)
    return {tag: (Kind.ASCII, text.encode()) for tag, text in told if text}


def _exif(metadata: Metadata, more: Tags) -> Tags:
    found = {**more, **_texts(metadata, _IN_EXIF)}
    for name in _NUMBERS:
        value = getattr(metadata, name)
        if value is not None:
            found[exif_tags.NUMBER_TAGS[name]] = Kind.RATIONAL, nearest_ratio(value)
    if metadata.iso is not None:
        found |= _sensitivity(max(1, round(metadata.iso)))
    return {_EXIF_VERSION: (Kind.UNDEFINED, EXIF_VERSION), **found} if found else {}


def _sensitivity(iso: int) -> dict[int, tuple[Kind, int]]:
    """Return the ISO speed, in the tag for large numbers too where it needs that."""
    found = {exif_tags.NUMBER_TAGS["iso"]: (Kind.SHORT, min(iso, MAX_SHORT))}
    if iso >= MAX_SHORT:
        found[_SENSITIVITY_TYPE] = Kind.SHORT, 2  # recommended exposure index
        found[exif_tags.RECOMMENDED_EXPOSURE_INDEX] = Kind.LONG, iso
    return found


def _gps(metadata: Metadata) -> Tags:
    latitude, longitude = metadata.latitude_deg, metadata.longitude_deg
    if latitude is None or longitude is None:
        return {}
    found: dict[int, tuple[Kind, object]] = {
        _GPS_VERSION: (Kind.BYTE, GPS_VERSION),
        exif_tags.LATITUDE_REF: (Kind.ASCII, b"S" if latitude < 0 else b"N"),
        exif_tags.LATITUDE: (Kind.RATIONAL, _sexagesimal(latitude)),
        exif_tags.LONGITUDE_REF: (Kind.ASCII, b"W" if longitude < 0 else b"E"),
        exif_tags.LONGITUDE: (Kind.RATIONAL, _sexagesimal(longitude)),
    }
    height = metadata.altitude_m
    if height is not None:
        found[exif_tags.ALTITUDE_REF] = Kind.BYTE, bytes((int(height < 0),))
        found[exif_tags.ALTITUDE] = Kind.RATIONAL, nearest_ratio(abs(height))
    return found


def _sexagesimal(degrees: float) -> tuple[Fraction, ...]:
    """Return degrees, minutes and seconds (to 3 mm on the ground) without sign."""
    parts = round(abs(degrees) * 3600 * _SECONDS_PARTS)
    minutes, seconds = divmod(parts, 60 * _SECONDS_PARTS)
    return Fraction(minutes // 60), Fraction(minutes % 60), Fraction(seconds, _SECONDS_PARTS)


def nearest_ratio(value: float) -> Fraction:
    """Return a number >= 0 as people would write it: 1/640, 63/10; six digits are kept.

    Exposure times come from files as decimals, as 32-bit numbers or as ratios.
    """
    limit = 100_000 if value >= 1e-4 or value == 0 else int(10 / value)
    return Fraction(f"{value:.6g}").limit_denominator(limit)
