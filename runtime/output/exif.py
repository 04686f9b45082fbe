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
    if not metadata.to_json():
        return b""
    start = len(header_bytes(0))
    main = {**main, **main_tags(metadata), exif_tags.ORIENTATION: (Kind.SHORT, UPRIGHT)}
    pointers, _ = sub_directories(metadata, 0, exif=exif)
    end = start + directory_length({**main, **pointers})
    pointers, sub_bytes = sub_directories(metadata, end, exif=exif)
    return header_bytes(start) + directory_bytes({**main, **pointers}, start) + sub_bytes


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
    data = b""
    more = exif if metadata.to_json() else NOTHING
    for pointer, tags in ((EXIF_POINTER, _exif(metadata, more)), (GPS_POINTER, _gps(metadata))):
        if tags:
            pointers[pointer] = Kind.LONG8 if big else Kind.LONG, offset + len(data)
            data += directory_bytes(tags, offset + len(data), big=big)
    return pointers, data


def _texts(metadata: Metadata, names: tuple[str, ...]) -> Tags:
    texts = ((exif_tags.TEXT_TAGS[name], getattr(metadata, name)) for name in names)
    return {tag: (Kind.ASCII, text.encode()) for tag, text in texts if text}


def _exif(metadata: Metadata, more: Tags) -> Tags:
    entries = {**more, **_texts(metadata, _IN_EXIF)}
    for name in _NUMBERS:
        value = getattr(metadata, name)
        if value is not None:
            entries[exif_tags.NUMBER_TAGS[name]] = Kind.RATIONAL, nearest_ratio(value)
    if metadata.iso is not None:
        entries |= _sensitivity(max(1, round(metadata.iso)))
    return {_EXIF_VERSION: (Kind.UNDEFINED, EXIF_VERSION), **entries} if entries else {}


def _sensitivity(iso: int) -> dict[int, tuple[Kind, int]]:
    """Return the ISO speed, in the tag for large numbers too where it needs that."""
    entries = {exif_tags.NUMBER_TAGS["iso"]: (Kind.SHORT, min(iso, MAX_SHORT))}
    if iso >= MAX_SHORT:
        entries[_SENSITIVITY_TYPE] = Kind.SHORT, 2  # recommended exposure index
        entries[exif_tags.RECOMMENDED_EXPOSURE_INDEX] = Kind.LONG, iso
    return entries


def _gps(metadata: Metadata) -> Tags:
    latitude, longitude = metadata.latitude_deg, metadata.longitude_deg
    if latitude is None or longitude is None:
        return {}
    entries: dict[int, tuple[Kind, object]] = {
        _GPS_VERSION: (Kind.BYTE, GPS_VERSION),
        exif_tags.LATITUDE_REF: (Kind.ASCII, b"S" if latitude < 0 else b"N"),
        exif_tags.LATITUDE: (Kind.RATIONAL, _sexagesimal(latitude)),
        exif_tags.LONGITUDE_REF: (Kind.ASCII, b"W" if longitude < 0 else b"E"),
        exif_tags.LONGITUDE: (Kind.RATIONAL, _sexagesimal(longitude)),
    }
    height = metadata.altitude_m
    if height is not None:
        entries[exif_tags.ALTITUDE_REF] = Kind.BYTE, bytes((int(height < 0),))
        entries[exif_tags.ALTITUDE] = Kind.RATIONAL, nearest_ratio(abs(height))
    return entries


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
