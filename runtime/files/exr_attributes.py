"""The metadata of a photograph as standard attributes of an OpenEXR file, and back.

Reference: OpenEXR, "Standard Attributes". Numbers are 32 bits there, the UTC offset is UTC less
local time, and there is no attribute for the artist. The comments hold camkit's record of the
place on the sensor, as the description of a DNG does.
"""

import math
import re
from collections.abc import Mapping
from typing import Any, Final

from camkit.runtime.files.raw_tags import SensorPlace, place_of_text
from camkit.runtime.metadata import Metadata

TEXTS: Final = {
    "make": "cameraMake",
    "model": "cameraModel",
    "lens_make": "lensMake",
    "lens_model": "lensModel",
    "copyright": "owner",
    "captured_at": "capDate",
}
NUMBERS: Final = {
    "exposure_time_s": "expTime",
    "f_number": "aperture",
    "iso": "isoSpeed",
    "focal_length_mm": "nominalFocalLength",
    "latitude_deg": "latitude",
    "longitude_deg": "longitude",
    "altitude_m": "altitude",
}
UTC_OFFSET: Final = "utcOffset"
COMMENTS: Final = "comments"
_HALF_MINUTE_S: Final = 30


def exr_attributes(metadata: Metadata) -> dict[str, bytes | float]:
    """Return the attributes of what is stated, text as UTF-8."""
    fields = metadata.to_json()
    attributes: dict[str, bytes | float] = {
        name: str(fields[key]).encode() for key, name in TEXTS.items() if key in fields
    }
    attributes |= {name: float(fields[key]) for key, name in NUMBERS.items() if key in fields}
    if metadata.utc_offset:
        attributes[UTC_OFFSET] = -_seconds(metadata.utc_offset)
    return attributes


def metadata_of_exr(header: Mapping[str, Any]) -> Metadata:
    """Return the metadata of the photograph in a header."""
    fields: dict[str, Any] = {key: header.get(name) for key, name in TEXTS.items()}
    fields |= {key: _short(header.get(name)) for key, name in NUMBERS.items()}
    return Metadata.believable(**fields, utc_offset=_offset(header.get(UTC_OFFSET)))


def place_of_exr(header: Mapping[str, Any]) -> SensorPlace:
    """Return camkit's record of the place on the sensor; all None in other files."""
    text = header.get(COMMENTS)
    return place_of_text(text) if isinstance(text, str) else SensorPlace()


def _short(value: Any) -> Any:
    """Return a 32-bit number by the digits that it holds."""
    return float(f"{value:.7g}") if isinstance(value, float) else value


def _seconds(offset: str) -> float:
    hours, minutes = (int(n) for n in re.findall(r"[0-9]+", offset))
    return float((hours * 60 + minutes) * 60 * (-1 if offset[0] == "-" else 1))


def _offset(seconds: Any) -> str:
    if not isinstance(seconds, float) or not math.isfinite(seconds):
        return ""
    minutes = int((abs(seconds) + _HALF_MINUTE_S) // 60)
    return f"{'-' if seconds > 0 else '+'}{minutes // 60:02d}:{minutes % 60:02d}"
