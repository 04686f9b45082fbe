"""Means over scenes and seeds, the scenes that end below their input, and the tables of both."""

import statistics
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from tools.tables.hdr.night_scenes import EASY, GROUPS, LDR_LIMIT_DB, SATURATED
from tools.tables.journal import Entry
from tools.tables.records import left_out_lines, markdown_table
from tools.tables.table_rows import Row

COLUMNS: Final = (
    *("hdr_psnr_db", "stops_rmse", "unclipped_psnr_db", "mu_psnr_db", "pu21_psnr_db", "jod"),
)
ALIGNED: Final = tuple(f"{name}_aligned" for name in COLUMNS)
OF_BARE: Final = "input_unclipped_psnr_db"
"""Of the bare lens, over the pixels that clip in neither capture of this camera."""
TIE_DB: Final = 0.5
GOOD_DB: Final = 65.0
MAIN: Final = "hdr_psnr_db"
GAIN: Final = "gain_db"
OVER_BARE: Final = "unclipped_over_bare_db"
HEADS: Final = {
    "hdr_psnr_db": "HDR, dB",
    GAIN: "over LDR, dB",
    "stops_rmse": "stops",
    "unclipped_psnr_db": "unclipped, dB",
    OVER_BARE: "over the bare lens there, dB",
    "mu_psnr_db": "mu-law, dB",
    "pu21_psnr_db": "PU21, dB",
    "jod": "JOD",
    "hdr_psnr_db_aligned": "HDR aligned, dB",
    "stops_rmse_aligned": "stops aligned",
    "cpu_s": "CPU-s",
}
DIGITS: Final = {"stops_rmse": 2, "stops_rmse_aligned": 2, "cpu_s": 2, "jod": 2}

Record = dict[str, Any]


@dataclass(slots=True, kw_only=True)
class Measured:
    """Measurements of the rows.

    Attributes:
        groups: Group -> scenes.
        entries: (run, scene) -> entry: `cpu_s` for the picture, by one thread, and `scores`.
        rows_left_out: Row -> why.
        scenes_left_out: File -> why.
    """

    groups: dict[str, list[str]] = field(default_factory=dict)
    entries: dict[tuple[str, str], Entry] = field(default_factory=dict)
    rows_left_out: dict[str, str] = field(default_factory=dict)
    scenes_left_out: dict[str, str] = field(default_factory=dict)


def record_of(
    bare: str, rows: Iterable[Row], measured: Measured, trained: Mapping[str, Any]
) -> Record:
    """Return everything that was measured as plain values.

    Args:
        bare: Row that all others are held against.
        rows: Those asked for.
        measured: Their measurements.
        trained: Training -> how it ended.
    """
    there = [row for row in rows if row.key not in measured.rows_left_out]
    return {
        "saturated": SATURATED,
        "ldr_limit_db": LDR_LIMIT_DB,
        "groups": {name: measured.groups[name] for name in GROUPS if name in measured.groups},
        "rows": {row.key: _row(bare, row, measured, trained) for row in there},
        "rows_left_out": dict(measured.rows_left_out),
        "scenes_left_out": dict(measured.scenes_left_out),
    }


def _row(bare: str, row: Row, measured: Measured, trained: Mapping[str, Any]) -> Record:
    names = [run.name for run in row.runs]
    return {
        "label": row.label,
        "trained": {name: trained[name] for name in names if name in trained},
        "groups": {
            name: _means(
                bare, [[measured.entries[run, s] for s in scenes] for run in names], measured
            )
            for name, scenes in measured.groups.items()
        },
        "below_input": [] if row.key == bare else below_input(bare, names, measured),
        "scenes": {
            scene: [_main(measured, run, scene) for run in names]
            for scenes in measured.groups.values()
            for scene in scenes
        },
    }


def below_input(bare: str, runs: Iterable[str], measured: Measured) -> list[str]:
    """Return scenes of LDR > 45 dB that end below the lesser of LDR - 0.5 and 65 dB, any seed."""
    easy = [scene for group in EASY for scene in measured.groups.get(group, ())]
    least_db = {scene: min(_main(measured, bare, scene) - TIE_DB, GOOD_DB) for scene in easy}
    return [
        scene
        for scene in easy
        if min(_main(measured, run, scene) for run in runs) < least_db[scene]
    ]


def _main(measured: Measured, run: str, scene: str) -> float:
    return float(measured.entries[run, scene]["scores"][MAIN])


def _means(bare: str, by_seed: list[list[Entry]], measured: Measured) -> Record:
    """Return mean and spread of every column: over scenes, then over seeds."""
    means: Record = {}
    for name in (*COLUMNS, *ALIGNED):
        values = [[e["scores"][name] for e in seed if name in e["scores"]] for seed in by_seed]
        if all(values):
            means[name] = _summary(values)
    means[GAIN] = _summary(
        [[e["scores"][MAIN] - _main(measured, bare, e["scene"]) for e in seed] for seed in by_seed]
    )
    pairs = [[e["scores"] for e in seed if OF_BARE in e["scores"]] for seed in by_seed]
    gains = [[s["unclipped_psnr_db"] - s[OF_BARE] for s in scores] for scores in pairs]
    if all(gains):
        means[OVER_BARE] = _summary(gains)
    means["cpu_s"] = _summary([[e["cpu_s"] for e in seed] for seed in by_seed])
    return means


def _summary(by_seed: list[list[float]]) -> Record:
    """Return the mean, its spread over seeds and that over scenes (n - 1); None for one alone."""
    means = [statistics.fmean(values) for values in by_seed]
    of_scenes = [statistics.fmean(values) for values in zip(*by_seed, strict=True)]
    return {
        "mean": statistics.fmean(means),
        "std_of_seeds": statistics.stdev(means) if len(means) > 1 else None,
        "std_of_scenes": statistics.stdev(of_scenes) if len(of_scenes) > 1 else None,
    }


def tables_text(record: Record) -> str:
    """Return the tables in Markdown, one for each group of scenes."""
    parts = [_table(record, group) for group in record["groups"]]
    return "\n\n".join([*parts, "\n".join([*_remarks(record), *left_out_lines(record)])]) + "\n"


def _table(record: Record, group: str) -> str:
    scenes, rows = record["groups"][group], record["rows"].values()
    there = [n for n in HEADS if any(n in row["groups"][group] for row in rows)]
    cells = [
        [row["label"], *(_cell(n, row["groups"][group].get(n), number == 0) for n in there)]
        for number, row in enumerate(rows)
    ]
    table = markdown_table(["row", *(HEADS[name] for name in there)], cells)
    return f"**{GROUPS[group]}** ({len(scenes)})\n\n{table}"


def _cell(name: str, summary: Record | None, is_bare: bool) -> str:
    if summary is None or (is_bare and name in {GAIN, OVER_BARE}):
        return ""
    digits = DIGITS.get(name, 1)
    sign = "+" if name in {GAIN, OVER_BARE} else ""
    text = f"{summary['mean']:{sign}.{digits}f}"
    spread = summary["std_of_seeds"]
    return text if spread is None else f"{text} +- {spread:.{max(digits, 2)}f}"


def _remarks(record: Record) -> Iterator[str]:
    yield "Means over scenes; +- is the standard deviation over seeds of training."
    for row in record["rows"].values():
        if row["below_input"]:
            yield (
                f"- {row['label']}: below the lesser of LDR - 0.5 and 65 dB on "
                f"{', '.join(row['below_input'])}"
            )
