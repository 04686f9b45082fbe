"""EXIF: where it lies in a PNG or JPEG, and what its tags say of a photograph.

The tags are read by `tiff_tags`, within its bounds; what is not believable counts as not stated.
References: Exif 2.32 (CIPA DC-008), 4.6; PNG, third edition, 11.3.4.5 (eXIf); ISO 10918-1, B.1.
"""

import math
from typing import Final

from camkit.runtime.files.formats import jpeg_segments, png_chunks
from camkit.runtime.files.tiff_tags import TiffTags, tags_of_block
from camkit.runtime.metadata import Metadata

TEXT_TAGS: Final = {
    "make": 271,
    "model": 272,
    "lens_make": 42035,
    "lens_model": 42036,
    "artist": 315,
    "copyright": 33432,
    "captured_at": 36867,
    "utc_offset": 36881,
}
NUMBER_TAGS: Final = {
    "exposure_time_s": 33434,
    "f_number": 33437,
    "iso": 34855,
    "focal_length_mm": 37386,
}
ORIENTATION: Final = 274
RECOMMENDED_EXPOSURE_INDEX: Final = 34866
ISO_IN_OTHER_TAG: Final = 65535
LATITUDE_REF, LATITUDE, LONGITUDE_REF, LONGITUDE, ALTITUDE_REF, ALTITUDE = range(1, 7)
BELOW_SEA_LEVEL: Final = 1

_EXIF_PREFIX: Final = b"Exif\0\0"
_APP1: Final = 0xE1
_NO_TAGS: Final = TiffTags(directories=(), file_bytes=0)


def exif_of_picture(data: bytes) -> TiffTags:
    """Return the EXIF tags of a PNG or JPEG; none where there are none or they cannot be found."""
    blocks = []
    if data.startswith(png_chunks.MAGIC):
        blocks = [content for name, content in png_chunks.png_chunks(data) if name == b"eXIf"]
    elif data.startswith(jpeg_segments.MAGIC):
        blocks = [
            segment.content
            for segment in jpeg_segments.header_segments(data)
            if segment.marker == _APP1 and segment.content.startswith(_EXIF_PREFIX)
        ]
    return tags_of_block(blocks[0].removeprefix(_EXIF_PREFIX)) if blocks else _NO_TAGS


def orientation_of(tags: TiffTags) -> int:
    """Return the EXIF orientation of the first picture, 1 where none is stated that exists."""
    first = tags.directories[0].get(ORIENTATION) if tags.directories else None
    number = first[0] if first else 1
    return int(number) if number in range(1, 9) else 1


def metadata_of(tags: TiffTags) -> Metadata:
    """Return the metadata in the tags of a photograph."""
    fields: dict[str, object] = {name: tags.text(tag) for name, tag in TEXT_TAGS.items()}
    fields |= {name: (tags.numbers(tag) or (None,))[0] for name, tag in NUMBER_TAGS.items()}
    if fields["iso"] == ISO_IN_OTHER_TAG:
        fields["iso"] = (tags.numbers(RECOMMENDED_EXPOSURE_INDEX) or (fields["iso"],))[0]
    return Metadata.believable(**fields, **_place(tags))


def is_stated(tags: TiffTags, name: str) -> bool:
    """Return whether a file has the tag of a field, be it empty or zero."""
    tag = TEXT_TAGS.get(name) or NUMBER_TAGS[name]
    return any(tag in directory for directory in tags.directories)


def _place(tags: TiffTags) -> dict[str, float | None]:
    """Return latitude, longitude and altitude with their signs."""
    height = (tags.numbers(ALTITUDE) or (math.nan,))[0]
    is_below = _is_below(tags)
    return {
        "latitude_deg": _degrees(tags, LATITUDE, LATITUDE_REF, "NS"),
        "longitude_deg": _degrees(tags, LONGITUDE, LONGITUDE_REF, "EW"),
        "altitude_m": -height if is_below else height,
    }


def _is_below(tags: TiffTags) -> bool:
    reference = tags.numbers(ALTITUDE_REF)
    return reference is not None and reference[0] == BELOW_SEA_LEVEL


def _degrees(tags: TiffTags, tag: int, reference: int, signs: str) -> float | None:
    """Return degrees, minutes and seconds as one signed number; None if they are incomplete."""
    parts, side = tags.numbers(tag), (tags.text(reference) or "").upper()[:1]
    if parts is None or len(parts) != 3 or not side or side not in signs:
        return None
    degrees = parts[0] + parts[1] / 60 + parts[2] / 3600
    return -degrees if side == signs[1] else degrees
