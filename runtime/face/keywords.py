"""The options of `camkit.load`, `camkit.process` and pools as keywords, for type checkers.

`Options`, `WriteOptions` and the kinds of cameras say what the keywords are; a test compares.
Options that a kind of somebody else's package brings are taken at run time all the same.
"""

from os import PathLike
from typing import Literal, TypedDict

from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.options import (
    Assumption,
    DemosaicMethod,
    Dtype,
    Laws,
    Mode,
    OnUnsafe,
    OutputColor,
    Provider,
    Quality,
    Scale,
)
from camkit.runtime.output.writer import FileFormat
from camkit.runtime.signal.tone_curve import Tone
from camkit.runtime.unit import Unit


class KindKeywords(TypedDict, total=False):
    """Options that the kinds of cameras that come with camkit add."""

    timing: str | PathLike[str] | None
    product: Literal["depth", "intensity", "transient", "lifetime"] | None
    pool: Literal["auto", "1", "3", "5", 1, 3, 5] | None
    returns: Literal["1", "2", 1, 2] | None


class LoadKeywords(KindKeywords, total=False):
    """The fields of `Options`, and what kinds add."""

    size: str | None
    quality: Quality
    scale: Scale
    max_seconds: float | None
    max_error_db: float | None
    depth_m: float | None
    configuration: str | int | None
    method: str | None
    mode: Mode
    demosaic: DemosaicMethod | None
    color: OutputColor
    white_balance: tuple[float, float, float] | None
    exposure_ev: float
    vignetting: bool
    undistort: bool
    origin_px: tuple[int, int] | None
    assume: Assumption | None
    force_bundle: bool
    on_unsafe: OnUnsafe
    laws: Laws
    strength: float
    max_mem_bytes: int | None
    threads: int | None
    tile_px: int | None
    tone: Tone | FilePath | None
    halves: tuple[str, str] | None
    noise: tuple[float, float] | None
    iso: float | None
    unit: Unit | FilePath | None
    dtype: Dtype
    provider: Provider


class PictureKeywords(TypedDict, total=False):
    """The fields of `WriteOptions` for one picture whose place is known."""

    format: FileFormat | None
    preview: bool
    linear: bool
    jpeg_quality: int | None
    strip_metadata: bool
    overwrite: bool


class ProcessKeywords(LoadKeywords, PictureKeywords, total=False):
    """Besides, the fields of `WriteOptions` for many."""

    out_dir: str | PathLike[str]
    keep_folders: bool
    resume: bool
    jobs: int
