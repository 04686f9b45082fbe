"""The record as tables in Markdown: every method at every level, then the scan of errors."""

from collections.abc import Iterable, Mapping
from typing import Any

Record = Mapping[str, Any]


def misetched_text(record: Record) -> str:
    """Give both tables."""
    sets = list(record["pictures"])
    lines = [
        f"every mask {record['depth_error']:+.0%}; PSNR in dB, {' / '.join(sets)}",
        "",
        *_table(["plate", "method", *record["photons"]], _methods(record)),
        "",
        f"without noise, {' / '.join(sets)}",
        "",
        *_table(
            ["every mask", "RMSE to the design", "network", "linear, design", "linear, true"],
            _scan(record),
        ),
    ]
    return "\n".join(lines) + "\n"


def _methods(record: Record) -> Iterable[list[str]]:
    for row in record["rows"]:
        scores = row["scores"]
        yield [row["plate"], row["method"], *(_sets(scores[n]) for n in record["photons"])]


def _scan(record: Record) -> Iterable[list[str]]:
    for row in record["scan"]:
        found = (_sets(row[name]) for name in ("network", "linear_design", "linear_true"))
        yield [f"{row['depth_error']:+.0%}", f"{row['like_design']['rmse']:.4f}", *found]


def _sets(scores: Record) -> str:
    return " / ".join(f"{score['psnr_db']:.2f}" for score in scores.values())


def _table(heads: list[str], rows: Iterable[list[str]]) -> Iterable[str]:
    yield _line(heads)
    yield "|---" * len(heads) + "|"
    yield from map(_line, rows)


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"
