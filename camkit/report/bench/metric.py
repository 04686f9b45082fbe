"""The type of a metric, and all metrics that are registered."""

from collections.abc import Callable
from dataclasses import dataclass

from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.report.bench.discovery import discover


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One number of a metric, and what it is called in a row.

    Attributes:
        name: Mean over pictures.
        spread: Its standard deviation over pictures.
        of_input: The same of the capture that was only developed.
    """

    name: str
    spread: str
    of_input: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A metric.

    Attributes:
        columns: What it measures.
        measure: Function of (result, truth), both (3, h, w); gives a value per column name.
        applies: Whether results of a bundle can be measured with it.
    """

    columns: tuple[Column, ...]
    measure: Callable[[FloatArray, FloatArray], dict[str, float]]
    applies: Callable[[Bundle], bool]


def registered_metrics() -> tuple[Metric, ...]:
    """Give all metrics that are registered."""
    return discover("camkit.report.bench.metrics", "METRIC", Metric)
