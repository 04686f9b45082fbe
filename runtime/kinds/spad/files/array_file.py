"""An array in any order of axes, read by strips of rows."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import DecodeError
from camkit.runtime.kinds.spad.files.axes import axes_of
from camkit.runtime.kinds.spad.files.counts_file import (
    CountsFile,
    CountsKind,
    Hints,
    checked_bins,
    checked_counts,
    checked_size,
)


class Sliced(Protocol):
    """Anything that can be sliced as an array: an array, a mapped file, a data set."""

    @property
    def shape(self) -> tuple[int, ...]: ...  # noqa: D102
    @property
    def dtype(self) -> np.dtype[Any]: ...  # noqa: D102
    def __getitem__(self, item: Any, /) -> Any: ...


class ArrayFile(CountsFile):
    """Counts that lie in one array."""

    def __init__(
        self,
        path: Path,
        values: Sliced,
        hints: Hints,
        *,
        kind: CountsKind | None = None,
        usual: str | None = "tyx",
        stated_times: Mapping[str, object] | None = None,
        assumed: Mapping[str, object] | None = None,
        close: Callable[[], None] | None = None,
    ) -> None:
        """Find the axes of an array.

        Args:
            path: Where it came from.
            values: (t, y, x) in any order, or (y, x); further axes where the caller names them.
            hints: What the caller knows.
            kind: What it holds; None: times where it has three axes, else counts.
            usual: The axes that it has unless the caller says otherwise; None if that is not known.
            stated_times: What it says of its times.
            assumed: What is usual of such files.
            close: Lets go of what it lies in.

        Raises:
            DecodeError: If it holds no numbers, has no pixels, or more bins than any capture.
            ContractError: If its axes are not known.
        """
        self.path, self.stated_times, self._close = (
            path,
            stated_times or {},
            close or (lambda: None),
        )
        self.assumed = assumed or {}
        if values.dtype.kind not in "biuf" or values.dtype.itemsize > 8:
            raise DecodeError(f"{path.name} holds {values.dtype}; expected numbers")
        if len(values.shape) < 2:
            raise DecodeError(
                f"{path.name} holds an array of {values.shape}; expected time, rows and columns, "
                "or rows and columns"
            )
        usual = "yx" if len(values.shape) == 2 else usual
        self._axes = axes_of(path, values.shape, hints.axes, usual)
        self.axes, is_flat = self._axes.text, "t" not in self._axes.remaining
        self._values = values
        sizes = dict(zip(self._axes.letters, values.shape, strict=True))
        self.height, self.width = checked_size(path, sizes["y"], sizes["x"])
        self.kind = kind or ("counts" if is_flat else "histogram")
        pixels = self.height * self.width
        self.bins = checked_bins(path, sizes.get("t", 1), pixels, self.kind)

    def rows(self, top: int, bottom: int, edges: NDArray[np.float64] | None = None) -> FloatArray:
        """Read some rows; see `CountsFile`."""
        del edges
        try:
            part = np.asarray(self._values[self._axes.at_rows(top, bottom)])
        except (OSError, ValueError, RuntimeError) as error:
            raise DecodeError(f"{self.path.name} is damaged: {error}") from error
        axes = self._axes.remaining
        if "t" not in axes:
            part, axes = part[..., None], axes + "t"
        return checked_counts(self.path, part.transpose([axes.index(a) for a in "yxt"]), top)

    def shares_memory(self, array: NDArray[Any]) -> bool:
        """Return whether an array may lie where the counts do."""
        return isinstance(self._values, np.ndarray) and np.may_share_memory(self._values, array)

    def close(self) -> None:
        """Release what it lies in."""
        self._close()
