"""Accuracy split by ISO and by place in the field: means as in a row, over fewer captures."""

from collections.abc import Callable, Iterable, Sequence
from statistics import fmean
from typing import Any

from camkit.report.bench.accuracy import CaptureScores, Scores
from camkit.report.bench.metric import Metric

Cell = dict[str, Any]


def split_columns(
    scores: Scores | None, of_input: Scores | None, metrics: Sequence[Metric]
) -> dict[str, list[Cell]]:
    """Return `by_iso`, `by_field` and `by_iso_and_field` of a row.

    A cell holds what its captures share (`iso`; `field_share`, and their mean `field_mm`), how
    many `captures` of how many `images` there are, and the mean over pictures of every column that
    has a spread in its row, and the same of the input. What is not known of a capture is None.

    Args:
        scores: Of the method.
        of_input: Of the input.
        metrics: Of the camera.
    """
    keys: dict[str, tuple[str, ...]] = {
        "by_iso": ("iso",),
        "by_field": ("field_share",),
        "by_iso_and_field": ("iso", "field_share"),
    }
    return {name: _cells(scores, of_input, metrics, shared) for name, shared in keys.items()}


def _cells(
    scores: Scores | None,
    of_input: Scores | None,
    metrics: Sequence[Metric],
    shared: tuple[str, ...],
) -> list[Cell]:
    def group(scored: CaptureScores) -> tuple[float | None, ...]:
        return tuple(getattr(scored, name) for name in shared)

    groups = _grouped(() if scores is None else scores.captures, group)
    inputs = _grouped(() if of_input is None else of_input.captures, group)
    cells = []
    for key in sorted(groups, key=lambda values: [(v is None, v or 0) for v in values]):
        captures = groups[key]
        cell: Cell = dict(zip(shared, key, strict=True))
        if "field_share" in shared:
            cell["field_mm"] = _mean(t.field_mm for t in captures)
        cell |= {"captures": len(captures), "images": len({t.picture for t in captures})}
        for column in (c for m in metrics for c in m.columns if c.spread is not None):
            cell[column.name] = picture_mean(captures, column.name)
            if column.of_input is not None:
                cell[column.of_input] = picture_mean(inputs.get(key, ()), column.name)
        cells.append(cell)
    return cells


def _grouped(
    captures: Iterable[CaptureScores], group: Callable[[CaptureScores], tuple[float | None, ...]]
) -> dict[tuple[float | None, ...], list[CaptureScores]]:
    groups: dict[tuple[float | None, ...], list[CaptureScores]] = {}
    for one in captures:
        groups.setdefault(group(one), []).append(one)
    return groups


def picture_mean(captures: Iterable[CaptureScores], column: str) -> float | None:
    """Return the mean over pictures of the means over their captures; None without any."""
    by_picture: dict[str, list[float]] = {}
    for one in captures:
        if column in one.values:
            by_picture.setdefault(one.picture, []).append(one.values[column])
    return _mean(fmean(values) for values in by_picture.values())


def _mean(values: Iterable[float | None]) -> float | None:
    numbers = [value for value in values if value is not None]
    return fmean(numbers) if numbers else None
