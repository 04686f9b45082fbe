"""The place and the format of the files of captures."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.field_types import check_fields
from camkit.runtime.output.picture_writer import DEFAULT_JPEG_QUALITY
from camkit.runtime.output.writer import SUFFIXES, FileFormat

OTHER_NAMES: Final[dict[str, FileFormat]] = {"jpg": "jpeg", "tif": "tiff"}
LINEAR_FORMATS: Final = frozenset({"exr", "dng"})


@dataclass(frozen=True, slots=True, kw_only=True)
class WriteOptions:
    """The place and the format of pictures.

    Attributes:
        out_dir: Folder of pictures and sidecars, made if needed.
        keep_folders: Below it, the folders of the captures from what they have in common on.
        format: exr, tiff (or tif), png, jpeg (or jpg) or dng; None for exr, and for no picture
            beside products.
        preview: A small tone-mapped JPEG beside the picture, see `tone_mapping`.
        linear: TIFF and PNG without the sRGB curve.
        jpeg_quality: Of JPEG, 1..100; None for 92.
        strip_metadata: Leave out what the capture says of camera, lens, date, exposure and place.
        resume: Skip what a sidecar proves done.
        overwrite: Replace pictures that exist.
        jobs: Captures at once; threads and memory are shared among them.
    """

    out_dir: Path = Path()
    keep_folders: bool = False
    format: FileFormat | None = None
    preview: bool = False
    linear: bool = False
    jpeg_quality: int | None = None
    strip_metadata: bool = False
    resume: bool = False
    overwrite: bool = False
    jobs: int = 1

    def __post_init__(self) -> None:
        named = OTHER_NAMES.get(str(self.format), self.format)
        object.__setattr__(self, "format", named)  # one name from here on
        check_fields(self)
        if self.linear and self.picture in LINEAR_FORMATS:
            raise ContractError(
                f"{self.picture} is always linear; leave {option_text('linear')} out"
            )
        if self.format == "jpeg" and self.linear:
            raise ContractError(
                f"8 bits hold no linear light; add {option_text('format')} png or tiff"
            )
        if self.jpeg_quality is not None and self.format != "jpeg":
            raise ContractError(f"a quality is for JPEG; leave it out for {self.picture}")
        if not 1 <= self.quality <= 100:
            raise ContractError(f"JPEG quality must be 1..100; got {self.jpeg_quality}")
        if self.jobs < 1:
            raise ContractError(f"jobs must be >= 1; got {self.jobs}")
        if self.resume and self.overwrite:
            raise ContractError("resume keeps what is done, overwrite redoes it: choose one")

    @property
    def picture(self) -> FileFormat:
        """Return the format of pictures."""
        return "exr" if self.format is None else self.format

    @property
    def quality(self) -> int:
        """Return the quality of a JPEG."""
        return DEFAULT_JPEG_QUALITY if self.jpeg_quality is None else self.jpeg_quality

    @property
    def suffix(self) -> str:
        """Return the suffix of the pictures, with its dot."""
        return "." + SUFFIXES[self.picture].lstrip(".")
