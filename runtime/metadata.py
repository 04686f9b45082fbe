"""Metadata of a photograph: camera, lens, date, exposure, place.

All of it is foreign: text is bounded and holds no control characters, numbers lie in ranges that
exist. A value that is not believable counts as not stated and never fails a picture.

    files.exif_tags, files.raw_metadata -> Metadata -> Capture -> output.origin -> every writer
"""

import math
import re
from dataclasses import asdict, dataclass, fields, replace
from datetime import datetime
from typing import Any, Final, Self

from camkit.errors import ContractError

MAX_TEXT: Final = 128
_RANGES: Final = {
    "exposure_time_s": (1e-7, 1e6),
    "f_number": (0.1, 1e4),
    "iso": (0.1, 4e9),
    "focal_length_mm": (0.01, 1e6),
    "latitude_deg": (-90.0, 90.0),
    "longitude_deg": (-180.0, 180.0),
    "altitude_m": (-1e5, 1e9),
}
_DATE: Final = re.compile(
    r"([0-9]{4})[:/-]([0-9]{2})[:/-]([0-9]{2})[ T]([0-9]{2}:[0-9]{2}:[0-9]{2})"
)
_UTC_OFFSET: Final = re.compile(r"[+-](0[0-9]|1[0-4]):[0-5][0-9]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Metadata:
    """The EXIF metadata that camkit carries into its pictures.

    Attributes:
        make: Maker of the camera; like all text empty if not stated.
        model: Model of the camera.
        lens_make: Maker of the lens.
        lens_model: Model of the lens.
        artist: Who took the photograph.
        copyright: Whose it is.
        captured_at: Local time as "YYYY:MM:DD hh:mm:ss".
        utc_offset: Local time less UTC, as "+hh:mm" or "-hh:mm".
        exposure_time_s: Exposure time; like all numbers None if not stated.
        f_number: Focal length by aperture.
        iso: ISO speed.
        focal_length_mm: Focal length of the lens.
        latitude_deg: North is positive; stated together with the longitude or not at all.
        longitude_deg: East is positive.
        altitude_m: Above sea level; only with a latitude.

    Raises:
        ContractError: If a value is not clean; `believable` cleans.
    """

    make: str = ""
    model: str = ""
    lens_make: str = ""
    lens_model: str = ""
    artist: str = ""
    copyright: str = ""
    captured_at: str = ""
    utc_offset: str = ""
    exposure_time_s: float | None = None
    f_number: float | None = None
    iso: float | None = None
    focal_length_mm: float | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None

    def __post_init__(self) -> None:
        values = asdict(self)
        for name, value in values.items():
            if value != _cleaned(name, value):
                raise ContractError(f"{name} of a photograph cannot be {value!r}")
        if _without_half_a_place(values) != values:
            raise ContractError("a place needs latitude and longitude, or neither")

    @classmethod
    def believable(cls, **values: Any) -> Self:
        """Return what can be believed of foreign values; an odd one counts as not stated.

        Args:
            **values: Fields by name, of any type and content.
        """
        cleaned = {name: _cleaned(name, value) for name, value in values.items()}
        empty = {f.name: f.default for f in fields(cls)}
        return cls(**_without_half_a_place(empty | cleaned))

    @property
    def camera(self) -> str:
        """Return make and model as people read them; empty if not stated."""
        if self.model.startswith(self.make):
            return self.model
        return f"{self.make} {self.model}".strip()

    def completed(self, **values: Any) -> "Metadata":
        """Return the same with further values where none is stated, as far as they can be believed.

        Args:
            **values: Fields by name.
        """
        more = asdict(Metadata.believable(**values))
        mine = self.to_json()
        return replace(self, **{k: v for k, v in more.items() if k not in mine})

    def to_json(self) -> dict[str, str | float]:
        """Return what is stated, by name, as plain JSON values."""
        return {name: value for name, value in asdict(self).items() if value not in ("", None)}


def _without_half_a_place(values: dict[str, Any]) -> dict[str, Any]:
    if values["latitude_deg"] is None or values["longitude_deg"] is None:
        return values | dict.fromkeys(("latitude_deg", "longitude_deg", "altitude_m"))
    return values


def _cleaned(name: str, value: Any) -> Any:
    """Return a field's value as far as it can be believed, else that for "not stated"."""
    if name in _RANGES:
        low, high = _RANGES[name]
        if isinstance(value, bool) or not isinstance(value, int | float):
            return None
        return float(value) if math.isfinite(value) and low <= value <= high else None
    text = clean_text(value)
    if name == "captured_at":
        return _date(text)
    if name == "utc_offset":
        return text if _UTC_OFFSET.fullmatch(text) else ""
    return text


def clean_text(value: Any) -> str:
    """Return foreign text without what does not print, and not too long; empty for other values."""
    if not isinstance(value, str):
        return ""
    printable = (c if c.isprintable() else " " for c in value[: 4 * MAX_TEXT])
    return " ".join("".join(printable).split())[:MAX_TEXT].strip()


def _date(text: str) -> str:
    match = _DATE.match(text)
    if not match:
        return ""
    year, month, day, time = match.groups()
    try:
        datetime.fromisoformat(f"{year}-{month}-{day} {time}")
    except ValueError:
        return ""
    return f"{year}:{month}:{day} {time}"
