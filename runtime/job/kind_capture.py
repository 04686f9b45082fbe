"""A capture of any kind, as the engine sees it."""

from typing import Any, Protocol

from numpy.typing import NDArray

from camkit.bundle.plane import Plane
from camkit.runtime.rows import RowSource


class KindCapture(Protocol):
    """One capture of a kind, closed by whoever read it; stages of the kind know more of it."""

    @property
    def height(self) -> int:
        """Return the number of rows."""
        ...

    @property
    def width(self) -> int:
        """Return the number of columns."""
        ...

    @property
    def channels(self) -> int:
        """Return the number of colours of the light."""
        ...

    @property
    def gives_own_rows(self) -> bool:
        """Return whether what `rows` reads is the reader's own to change."""
        ...

    @property
    def resident_bytes(self) -> int:
        """Return the memory that the samples take while they are worked on."""
        ...

    @property
    def decoder_peak_mb(self) -> float:
        """Return the peak memory of another process that decoded it."""
        ...

    @property
    def sha256(self) -> str | None:
        """Return the hash of its file, where reading computed it."""
        ...

    def plane(self, stated: Plane | None) -> Plane:
        """Return what the samples are; `stated` is the plane of a bundle's sensor."""
        ...

    def rows(self) -> RowSource:
        """Return the samples as the file holds them."""
        ...

    def gives(self, plane: Plane) -> bool:
        """Return whether a plane can be a product of this capture."""
        ...

    def shares_memory(self, array: NDArray[Any]) -> bool:
        """Return whether an array may lie where the samples do."""
        ...

    def close(self) -> None:
        """Release its file."""
        ...
