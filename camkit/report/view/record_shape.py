"""The types of what is read in a sidecar, so that an edited one is refused by a name."""

from typing import Annotated, Any

from annotated_types import Len
from pydantic import BaseModel, Field, NonNegativeFloat, PositiveFloat, PositiveInt, ValidationError

_Name = Annotated[str, Field(pattern=r"\S")]


class _Decision(BaseModel):
    what: str
    choice: object
    reason: object
    saving_s: float | None
    cost_db: float


class _Cells(BaseModel):
    side_px: PositiveInt
    rows: Annotated[list[str], Len(1)]


class _Envelope(BaseModel):
    conditions: dict[str, float] = Field(default={}, alias="seen")
    outside: list[str] = []


class _Stage(BaseModel):
    way: object = None


class _Plan(BaseModel):
    size: str | None = None
    decisions: list[_Decision] = []
    cells: _Cells | None = None
    envelope: _Envelope = _Envelope()
    stages: dict[str, _Stage] = {}


class _Metadata(BaseModel):
    lens_model: str | None = None


class _Highlights(BaseModel):
    regions: float = 0
    saturated_fraction: float = 0
    unexplained: float = 0


class _Photons(BaseModel):
    photons: NonNegativeFloat | None = None
    pixels: int | None = None
    valid: Annotated[list[int], Len(1)] | None = None


class _Mosaic(BaseModel, extra="forbid"):
    cfa: str | None = None
    black_level: float | None = None
    white_level: float | None = None


class _Options(BaseModel):
    of_kind: dict[str, Any] = {}
    white_balance: list[float] | None = None
    origin_px: list[float] | None = None
    mosaic: _Mosaic | None = None


class _Record(BaseModel):
    input: _Name
    output: _Name
    input_sha256: str
    output_sha256: str
    bundle: str | None = None
    bundle_sha256: str | None
    size: str | None = None
    camera: str | None = None
    iso: float | None = None
    exposure_time_s: PositiveFloat | None = None
    orientation: Annotated[int, Field(ge=1, le=8)] = 1
    seconds: dict[str, NonNegativeFloat]
    peak_rss_mb: NonNegativeFloat
    clipped_fraction: float | None
    warnings: list[_Name]
    extra_files: list[_Name] = Field(default=[], alias="beside")
    options: _Options
    plan: _Plan
    metadata: _Metadata | None = None
    hdr: _Highlights = _Highlights()
    spad: _Photons = _Photons()


def record_fault(record: object) -> str | None:
    """Return what of a sidecar is of another type than camkit writes; None for nothing."""
    try:
        _Record.model_validate(record, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        return f"{place}: {first['msg'][0].lower()}{first['msg'][1:]}"
    return None
