"""The metadata of a RAW file: from its tags, and from LibRaw where it has none.

LibRaw knows the formats that are no TIFF (CRW, CR3, RAF) and lenses that only makers' notes name.
What no number of its own tells (maker, place) it writes into the JPEG that it hands out as preview.
"""

from datetime import datetime
from typing import Any, Final

from camkit.runtime.files.exif_tags import exif_of_picture, is_stated, metadata_of
from camkit.runtime.files.raw_tags import UNIQUE_CAMERA_MODEL
from camkit.runtime.files.tiff_tags import TiffTags
from camkit.runtime.metadata import Metadata

_EPOCH_YEAR: Final = 1970


def raw_metadata(raw: Any, tags: TiffTags) -> Metadata:
    """Return the metadata of a RAW file's photograph.

    A tag that is there and empty or zero means that the camera did not know, so that LibRaw, which
    then assumes something, is asked only for what the file has no tag of.

    Args:
        raw: The file as rawpy opened it.
        tags: Its directories; none where it is no TIFF.
    """
    mine = metadata_of(tags)
    decoded = {k: v for k, v in _of_libraw(raw).items() if v and not is_stated(tags, k)}
    metadata = mine.completed(**decoded)
    if not tags.directories:
        return metadata.completed(**_of_preview(raw).to_json())
    return metadata if metadata.camera else metadata.completed(model=tags.text(UNIQUE_CAMERA_MODEL))


def _of_libraw(raw: Any) -> dict[str, Any]:
    other, lens = getattr(raw, "other", None), getattr(raw, "lens", None)
    when: datetime | None = getattr(other, "timestamp", None)
    return {
        "exposure_time_s": _short(getattr(other, "shutter_speed", None)),
        "f_number": _short(getattr(other, "aperture", None)),
        "iso": _short(getattr(other, "iso_speed", None)),
        "focal_length_mm": _short(getattr(other, "focal_length", None)),
        "artist": getattr(other, "artist", None),
        "lens_make": getattr(lens, "make", None),
        "lens_model": getattr(lens, "model", None),
        "captured_at": when.isoformat(" ") if when and when.year > _EPOCH_YEAR else None,
    }


def _short(value: float | None) -> float | None:
    """Return a float32 of LibRaw by the digits that it holds."""
    return None if value is None else float(f"{value:.7g}")


def _of_preview(raw: Any) -> Metadata:
    import rawpy

    try:
        preview = raw.extract_thumb()
    except (rawpy.LibRawError, rawpy.NotSupportedError, ValueError, MemoryError):
        return Metadata()
    is_jpeg = preview.format == rawpy.ThumbFormat.JPEG
    return metadata_of(exif_of_picture(preview.data)) if is_jpeg else Metadata()
