"""A capture of single photons, open: its size, what it states, and its rows when asked."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal, Self

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import DecodeError

CountsKind = Literal["histogram", "counts", "stamps"]
KEYS: Final[Mapping[str, CountsKind]] = {"histogram": "histogram", "counts": "counts"}
"""Names of variables that say what they hold."""
EXTRA: Final = 'pip install "camkit[spad]"'
MOST_COUNT: Final = 2**24
"""Whole numbers up to here are exact in float32."""
MOST_PIXELS: Final = 100_000_000
MOST_BINS: Final = 100_000
MOST_COUNTS: Final = 10_000_000_000
"""Of a capture in all: 40 GB where they are worked with."""
ARRIVALS: Final[Mapping[str, object]] = MappingProxyType({"orientation": "histogram"})
"""What is usual of files that hold when photons came."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hints:
    """The caller's facts about a file.

    Attributes:
        axes: Of the file's array in its order, such as "yxt"; see `Axes`.
        key: The variable, data set, channel or block to take.
        max_bytes: What may be held at once.
    """

    axes: str | None = None
    key: str | None = None
    max_bytes: int = 930_000_000


class CountsFile(ABC):
    """An open file; closes with `with`.

    Attributes:
        path: The file.
        kind: histogram: photons by time. counts: photons of one picture or of frames. stamps: the
            time of every photon, sorted into bins when rows are read.
        height: Rows of pixels.
        width: Pixels of a row.
        bins: Time bins, or frames; 0 for stamps.
        stated_times: What the file says of its times, by the names of the timing file.
        assumed: What is usual of such files; what anyone states goes before.
        axes: Of the file's array in its order, as a caller would state them; empty where nobody
            can.
    """

    path: Path
    kind: CountsKind
    height: int
    width: int
    bins: int
    stated_times: Mapping[str, object]
    assumed: Mapping[str, object] = MappingProxyType({})
    axes: str = ""

    @property
    def outside(self) -> int:
        """Return how many time stamps of the rows read so far lay outside all bins."""
        return 0

    @abstractmethod
    def rows(self, top: int, bottom: int, edges: NDArray[np.float64] | None = None) -> FloatArray:
        """Read some rows.

        Args:
            top: The first.
            bottom: The one after the last.
            edges: (bins + 1,) of time bins, in the unit of the stamps; for stamps alone.

        Returns:
            (rows, width, bins) float32, whole numbers >= 0; the caller's own.

        Raises:
            DecodeError: If the file is damaged, or what it holds are no counts.
        """

    def shares_memory(self, _array: NDArray[Any]) -> bool:
        """Return whether an array may lie where the counts do."""
        return False

    @abstractmethod
    def close(self) -> None:
        """Release the file."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def checked_size(path: Path, height: int, width: int) -> tuple[int, int]:
    """Refuse an array without pixels, or with more than any array has.

    Raises:
        DecodeError: Says what came.
    """
    if height < 1 or width < 1 or height * width > MOST_PIXELS:
        raise DecodeError(
            f"{path.name} holds {width}x{height} pixels; expected some, and not more "
            f"than {MOST_PIXELS // 10**6} million"
        )
    return height, width


def checked_bins(path: Path, bins: int, pixels: int, kind: CountsKind) -> int:
    """Refuse an array without times or frames, or with more than any capture has.

    Raises:
        DecodeError: Says what came.
    """
    name = "frames" if kind == "counts" else "time bins"
    if bins < 1:
        raise DecodeError(f"{path.name} has no {name}: 0 for {pixels} pixels; expected some")
    if kind != "counts" and bins > MOST_BINS:
        raise DecodeError(
            f"{path.name} has {bins} time bins; expected at most {MOST_BINS}: put bins together, "
            f"or state [array] axes in a file for {option_text('timing')} if time is another axis"
        )
    if bins * pixels > MOST_COUNTS:
        raise DecodeError(
            f"{path.name} holds {bins} {name} of {pixels} pixels; expected at most "
            f"{MOST_COUNTS} counts in all: cut it into several files"
        )
    return bins


def checked_counts(path: Path, values: NDArray[Any], top: int) -> FloatArray:
    """Return values (rows, w, n) as counts.

    Raises:
        DecodeError: If one is negative, fractional, not finite or beyond what is exact; names
            where the first is.
    """
    counts = np.ascontiguousarray(values, dtype=np.float32)
    if values.dtype.kind == "b" or (values.dtype.kind == "u" and values.dtype.itemsize <= 2):
        return counts.copy() if np.shares_memory(counts, values) else counts
    with np.errstate(invalid="ignore"):
        bad = ~((values >= 0) & (values <= MOST_COUNT))
        if values.dtype.kind == "f":
            bad |= values != np.floor(values)
    if bad.any():
        y, x, t = (int(i) for i in np.argwhere(bad)[0])
        raise DecodeError(
            f"{path.name} holds no counts: {values[y, x, t]} at pixel ({x}, {y + top}), bin {t}; "
            "expected whole numbers >= 0"
        )
    return counts.copy() if np.shares_memory(counts, values) else counts
