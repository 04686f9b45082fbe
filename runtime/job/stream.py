"""A plane on its way from the stage that gives it to the one that takes it.

a source (rows of any place, made when asked for)    or    bands (from top to bottom, once)
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from camkit.bundle.plane import Plane
from camkit.errors import ContractError
from camkit.runtime.clock import StageClock, TimedRows
from camkit.runtime.job.meter import Meter, MeteredRows
from camkit.runtime.rows import PiecedRows, RollingRows, RowReader, Rows, RowSource, read_bands

Shape = tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """The rows of a plane, for one taker.

    Attributes:
        plane: What the rows hold.
        shape: (channel, h, w).
        gains: What the light of each channel of the sensor was multiplied by so far.
        source: Rows that may be read from any row on; None for bands.
        band_iterator: Bands from top to bottom, each an array that nobody else reads; None for a
            source.
        owned: Whether what the source reads is the reader's own to change.
        noise_rise: Gives what the variance of the noise of every channel was multiplied by besides,
            on average; to be asked when the first row is, as `Job.probe`. None for nothing.
        facts: What the giver knows of the rows besides, for stages of its kind; what is known of
            single rows is complete once they are read. None for nothing.
    """

    plane: Plane
    shape: Shape
    gains: tuple[float, ...]
    source: RowSource | None = None
    band_iterator: Iterator[Rows] | None = None
    owned: bool = True
    noise_rise: Callable[[], tuple[float, ...]] | None = None
    facts: Any = None

    def __post_init__(self) -> None:
        if (self.source is None) == (self.band_iterator is None):
            raise ContractError("a stream is either a source or bands")

    @property
    def gives_own_rows(self) -> bool:
        """Return whether what `rows` reads is the reader's own to change."""
        return self.source is not None and self.owned

    def rows(self) -> RowSource:
        """Return the rows, to be read from top to bottom with any overlap."""
        if self.source is not None:
            return self.source
        return self.pieced()

    def pieced(self) -> PiecedRows:
        """Return the rows as they lie, each kept until it is read."""
        if isinstance(self.source, RowReader):
            return self.source
        return RollingRows(self.shape, self.bands()).reader()

    def bands(self) -> Iterator[Rows]:
        """Yield the rows from top to bottom, each band an array that nobody else reads."""
        if self.band_iterator is not None:
            return self.band_iterator
        assert self.source is not None
        bands = read_bands(self.source)
        return bands if self.owned else (band.copy() for band in bands)

    def timed(self, clock: StageClock, name: str) -> "Stream":
        """Return the stream whose making is charged to a stage."""
        if self.band_iterator is not None:
            return replace(self, band_iterator=clock.bands(name, self.band_iterator))
        assert self.source is not None
        return replace(self, source=TimedRows(self.source, clock, name))

    def metered(self, meter: Meter, key: str) -> "Stream":
        """Return the stream whose rows are counted."""
        if self.band_iterator is not None:
            return replace(self, band_iterator=meter.bands(key, self.band_iterator, self.shape[1]))
        assert self.source is not None
        return replace(self, source=MeteredRows(self.source, meter, key))

    def shared(self, takers: int) -> list["Stream"]:
        """Return a stream for each of several takers; rows are kept until all have read them."""
        if takers < 2:
            return [self][:takers]
        rolling = RollingRows(self.shape, self.bands())
        return [
            replace(self, source=rolling.reader(), band_iterator=None, owned=False)
            for _ in range(takers)
        ]

    def with_bands(self, bands: Iterator[Rows]) -> "Stream":
        """Return what a stage made of this stream, of the same shape and meaning."""
        return replace(self, band_iterator=bands, source=None, owned=True)

    def with_source(self, source: RowSource) -> "Stream":
        """Return what a stage makes of this stream, readable from any row on."""
        return replace(self, source=source, band_iterator=None, shape=source.shape, owned=True)
