"""A capture of any kind, as the engine sees it."""

from typing import Any, Protocol

from numpy.typing import NDArray

from camkit.bundle.plane import Plane
from camkit.runtime.rows import RowSource


class KindCapture(Protocol):
    """One capture of a kind, closed by whoever read it; stages of the kind know more of it.

    Attributes:
        height: Rows.
        width: Columns.
        channels: Colours of the light.
        gives_own_rows: Whether what `rows` reads is the reader's own to change.
        resident_bytes: Memory that the samples take while they are worked on.
        decoder_peak_mb: Peak memory of another process that decoded it.
        sha256: Hash of its file, where reading computed it.
    """

    @property
    def height(self) -> int: ...  # noqa: D102
    @property
    def width(self) -> int: ...  # noqa: D102
    @property
    def channels(self) -> int: ...  # noqa: D102
    @property
    def gives_own_rows(self) -> bool: ...  # noqa: D102
    @property
    def resident_bytes(self) -> int: ...  # noqa: D102
    @property
    def decoder_peak_mb(self) -> float: ...  # noqa: D102
    @property
    def sha256(self) -> str | None: ...  # noqa: D102

    def plane(self, sensor_plane: Plane | None) -> Plane:
        """Return what the samples are; `sensor_plane` is the plane of a bundle's sensor."""

    def rows(self) -> RowSource:
        """Return the samples as the file holds them."""

    def gives(self, plane: Plane) -> bool:
        """Return whether a plane can be a product of this capture."""

    def shares_memory(self, array: NDArray[Any]) -> bool:
        """Return whether an array may lie where the samples do."""

    def close(self) -> None:
        """Release its file."""
