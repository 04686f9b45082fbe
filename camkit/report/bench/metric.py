"""The type of a metric, and the metrics that any kind of camera may name."""

from collections.abc import Callable
from dataclasses import dataclass

from camkit.bundle.golden import IMAGE
from camkit.contracts import FloatArray
from camkit.report.discovery import discover


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
        name: By which kinds of cameras name it.
        columns: What it measures.
        measure: Function of (result, truth), both (c, h, w); gives a value per column name.
        product: Which of the results.
    """

    name: str
    columns: tuple[Column, ...]
    measure: Callable[[FloatArray, FloatArray], dict[str, float]]
    product: str = IMAGE


def registered_metrics() -> tuple[Metric, ...]:
    """Give the metrics that any kind of camera may name."""
    return discover("camkit.report.bench.metrics", "METRIC", Metric)
