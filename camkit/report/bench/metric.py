"""The type of a metric, and the metrics that any kind of camera may name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from camkit.bundle.golden import IMAGE
from camkit.report.discovery import discover


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One number of a metric, and what it is called in a row.

    Attributes:
        name: Mean over pictures.
        spread: Its standard deviation over pictures; None for a number that stands alone, without
            spread, gain and their errors.
        of_input: The same of the input: of the picture that the capture brings as `input`, else of
            the capture that was only developed; None if that would say nothing.
    """

    name: str
    spread: str | None = None
    of_input: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A metric.

    Attributes:
        name: By which kinds of cameras name it.
        columns: What it measures.
        measure: Function of (result, truth), both (c, h, w), and of what `needs` and `takes` name,
            by keyword; gives a value per column name. A column that cannot be measured on a
            capture is left out.
        product: Which of the results.
        needs: Names of what it needs beside the truth, see `KnownCapture.extras`; a capture
            without them is not measured.
        takes: Names of what it takes where a capture brings it, or the bench a setting.
        notes: Gives texts that stand in every row, by name: how a number is to be read.
        each_picture: Whether a row also holds its numbers of each picture.
    """

    name: str
    columns: tuple[Column, ...]
    measure: Callable[..., dict[str, float]]
    product: str = IMAGE
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()
    notes: Callable[[], Mapping[str, str]] | None = None
    each_picture: bool = False


def registered_metrics() -> tuple[Metric, ...]:
    """Return the metrics that any kind of camera may name."""
    return discover("camkit.report.bench.metrics", "METRIC", Metric)
