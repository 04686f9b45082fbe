"""The record as tables in Markdown: every method at every level, then the scan of errors."""

from collections.abc import Iterator, Mapping
from typing import Any

Record = Mapping[str, Any]


def misetched_text(record: Record) -> str:
    """Return both tables."""
    sets = " / ".join(record["pictures"])
    methods = [["every mask", "method", *record["photons"]], *_methods(record)]
    errors = [["every mask", "RMSE to the design", *record["scan"][0]["methods"]], *_scan(record)]
    return (
        f"PSNR in dB, {sets}\n\n{_table(methods)}\n\n"
        f"without noise, PSNR in dB, {sets}\n\n{_table(errors)}\n"
    )


def _methods(record: Record) -> Iterator[list[str]]:
    for plate in (record["designed"], *record["etched"]):
        error = f"{plate['depth_error']:+.0%}" if "depth_error" in plate else "as designed"
        for name, scores in plate["methods"].items():
            yield [error, name, *(_sets(scores[level]) for level in record["photons"])]


def _scan(record: Record) -> Iterator[list[str]]:
    for plate in record["scan"]:
        found = map(_sets, plate["methods"].values())
        yield [f"{plate['depth_error']:+.0%}", f"{plate['like_design']['rmse']:.4f}", *found]


def _sets(scores: Record) -> str:
    return " / ".join(f"{score['psnr_db']:.2f}" for score in scores.values())


def _table(rows: list[list[str]]) -> str:
    head, *body = ["| " + " | ".join(cells) + " |" for cells in rows]
    return "\n".join([head, "|---" * len(rows[0]) + "|", *body])
