"""The base of all picture writers: the format, and bands that arrive from top to bottom.

A writer codes a band (`encode`) and appends coded rows (`store`). A picture that must be turned is
collected whole between the two.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, Self, final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.color import ColorStage
from camkit.runtime.geometry.turning import turn_back
from camkit.runtime.output.origin import Origin

Tone = Literal["srgb", "linear"]
Codes = NDArray[Any]

UPRIGHT: Final = 1
TURNED_ROWS: Final = 128
"""Rows of a turned picture that are stored at a time."""
DEFAULT_JPEG_QUALITY: Final = 92


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureFormat:
    """The format of a picture, and the meaning of its numbers.

    Attributes:
        width: Columns in sensor orientation.
        height: Rows in sensor orientation.
        color: What the numbers mean.
        orientation: EXIF orientation 1..8; the pixels are turned so that the file needs none.
        tone: Curve of TIFF, PNG and JPEG.
        jpeg_quality: Of JPEG, 1..100.
        full_float: EXR in 32 bits, whatever its values.
        is_grey: Whether the file holds one channel, the first of three that are equal.
        origin: Where the picture comes from.
    """

    width: int
    height: int
    color: ColorStage
    orientation: int = UPRIGHT
    tone: Tone = "srgb"
    jpeg_quality: int = DEFAULT_JPEG_QUALITY
    full_float: bool = False
    is_grey: bool = False
    origin: Origin = field(default_factory=Origin)

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ContractError(f"a picture needs sides >= 1; got {self.width}x{self.height}")
        if self.orientation not in range(1, 9):
            raise ContractError(f"EXIF orientation must be 1..8; got {self.orientation}")
        if not 1 <= self.jpeg_quality <= 100:
            raise ContractError(f"JPEG quality must be 1..100; got {self.jpeg_quality}")

    @property
    def channels(self) -> int:
        """Return the number of channels of the file."""
        return 1 if self.is_grey else 3

    @property
    def file_size(self) -> tuple[int, int]:
        """Return (width, height) of the file, after turning."""
        turned = self.orientation >= 5
        return (self.height, self.width) if turned else (self.width, self.height)


class PictureWriter(ABC):
    """Takes (3, rows, w) bands in sensor orientation from top to bottom, then is closed.

    As a context it closes the file at the end of the block, or lets go of it after an error.
    """

    def __init__(self, path: Path, picture: PictureFormat) -> None:
        self.path = path
        self.picture = picture
        self._rows = 0
        self._turned: Codes | None = None
        self._failure: Exception | None = None

    @abstractmethod
    def encode(self, band: FloatArray) -> Codes:
        """Return the band as the file holds it: (channel, rows, w)."""

    @abstractmethod
    def store(self, rows: Codes) -> None:
        """Append coded (channel, rows, w) in file orientation."""

    @abstractmethod
    def finish(self) -> None:
        """Complete the file; called once, after the last row."""

    @abstractmethod
    def release(self) -> None:
        """Release the file as it is, after an error."""

    @final
    def __enter__(self) -> Self:
        return self

    @final
    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self._turned = None
            self.release()

    @final
    def write(self, band: FloatArray) -> None:
        """Append a band of linear output colour.

        Raises:
            ContractError: If the band does not fit the picture or holds NaN or inf.
            OSError: If the file cannot be written; every later band raises the same error and
                touches nothing, since OpenEXR never returns from a call after a failed one.
        """
        if self._failure is not None:
            raise self._failure
        try:
            self._append(band)
        except Exception as error:
            self._failure = error
            raise

    @final
    def close(self) -> None:
        """Complete the file.

        Raises:
            ContractError: If rows are missing.
        """
        if self._rows != self.picture.height:
            raise ContractError(f"{self.picture.height} rows expected; got {self._rows}")
        if self._turned is not None:
            for top in range(0, self._turned.shape[1], TURNED_ROWS):
                self.store(np.ascontiguousarray(self._turned[:, top : top + TURNED_ROWS]))
            self._turned = None
        self.finish()

    def _append(self, band: FloatArray) -> None:
        self._check(band)
        top = self._rows
        self._rows += band.shape[1]
        coded = self.encode(band[: self.picture.channels])
        if self.picture.orientation == UPRIGHT:
            self.store(coded)
        else:
            self._keep(coded, top)

    def _keep(self, coded: Codes, top: int) -> None:
        """Copy rows to their place in the picture as it will be turned."""
        width, height = self.picture.file_size
        if self._turned is None:
            self._turned = np.empty((len(coded), height, width), dtype=coded.dtype)
        elif not np.can_cast(coded.dtype, self._turned.dtype):
            self._turned = self._turned.astype(coded.dtype)  # EXR beyond the range of half
        stored = turn_back(self._turned, self.picture.orientation)
        stored[:, top : top + coded.shape[1]] = coded

    def _check(self, band: FloatArray) -> None:
        width, left = self.picture.width, self.picture.height - self._rows
        if band.ndim != 3 or (band.shape[0], band.shape[2]) != (3, width) or band.shape[1] > left:
            raise ContractError(f"a band must be (3, <= {left}, {width}); got {band.shape}")
        # min and max hand NaN on, so two numbers tell of all pixels.
        if not (np.isfinite(band.min()) and np.isfinite(band.max())):
            raise ContractError(
                f"rows {self._rows}..{self._rows + band.shape[1]} hold NaN or inf; "
                "the picture is not written"
            )
