"""Measurements as plain values: means with their spread over seeds, and gains.

spread of a mean   standard deviation over seeds of training (n - 1); null for one
spread of a gain   root of the sum of both rows' variances over seeds; beside it the standard
                   error over pictures, whose gain is taken one by one
"""

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from camkit.models_def.toml_table import read_table
from tools.tables.journal import Entry
from tools.tables.records import left_out_lines, markdown_table
from tools.tables.table_rows import Row

Record = dict[str, Any]

GAINS: Final = {
    "learned.M over low_fill.M": ("learned.M", "low_fill.M"),
    "learned.M over gaussian.M": ("learned.M", "gaussian.M"),
    "learned.M over full_fill.M": ("learned.M", "full_fill.M"),
    "learned.M over full_fill.M=equal": ("learned.M", "full_fill.M=equal"),
    "learned.M over learned.dbpn": ("learned.M", "learned.dbpn"),
    "learned.M over learned.linear": ("learned.M", "learned.linear"),
}
ROWS_FILE: Final = Path(__file__).with_name("rows.toml")
THESIS: Final[Record] = read_table(ROWS_FILE, "table")["thesis"]
"""Row -> set -> PSNR in dB and SSIM, as printed."""
LEVELS: Final = (math.inf, 1e4, 1e3, 1e2)
"""Photons of white."""
TITLES: Final = {"set5": "Set5", "set14": "Set14", "bsd100_half_a": "BSD100, half a"}
NOISE_FREE: Final = "noise-free"
REMARK: Final = (
    "+- is the standard deviation over seeds of training, in brackets the standard error of a "
    "gain over pictures. The thesis's figures are as printed, of all of BSD100; its SRCNN and "
    "VDSR stand behind nothing, and all its other rows are D-DBPN."
)


@dataclass(slots=True, kw_only=True)
class Measured:
    """Measurements of the rows.

    Attributes:
        pictures: Set -> how many.
        entries: (run, set, photons of white) -> entry: `psnr_db` and `ssim` of every picture,
            `cpu_s` for all of them.
        seeds: Row -> those of its trainings that ended.
        mac_per_px: Row -> multiply-adds per pixel of the array.
        rows_left_out: Row -> why.
        sets_left_out: Set -> why.
    """

    pictures: dict[str, int] = field(default_factory=dict)
    entries: dict[tuple[str, str, float], Entry] = field(default_factory=dict)
    seeds: dict[str, tuple[int, ...]] = field(default_factory=dict)
    mac_per_px: dict[str, float] = field(default_factory=dict)
    rows_left_out: dict[str, str] = field(default_factory=dict)
    sets_left_out: dict[str, str] = field(default_factory=dict)


def record_of(rows: Iterable[Row], measured: Measured, trained: Mapping[str, Any]) -> Record:
    """Return everything that was measured.

    Args:
        rows: Those asked for.
        measured: Their measurements.
        trained: Training -> how it ended.
    """
    there = {row.key: row for row in rows if row.key not in measured.rows_left_out}
    return {
        "pictures": dict(measured.pictures),
        "photons": [level_name(level) for level in LEVELS],
        "rows": {key: _row(row, measured, trained) for key, row in there.items()},
        "gains": {
            name: _gain(there[one], there[other], measured)
            for name, (one, other) in GAINS.items()
            if one in there and other in there
        },
        "seeds_left_out": {
            key: missing
            for key, row in there.items()
            if (missing := [seed for seed in row.seeds if seed not in measured.seeds[key]])
        },
        "rows_left_out": dict(measured.rows_left_out),
        "sets_left_out": dict(measured.sets_left_out),
    }


def level_name(photons: float) -> str:
    """Return the name of a level of light."""
    return NOISE_FREE if math.isinf(photons) else f"{photons:g}"


def _row(row: Row, measured: Measured, trained: Mapping[str, Any]) -> Record:
    runs = [run.training for run in row.runs]
    return {
        "label": row.label,
        "sampling": row.optics,
        "method": row.method,
        "light": "equal counts" if row.equal_counts else "its own",
        "mac_per_px": measured.mac_per_px.get(row.key),
        "trained": {run: trained[run] for run in runs if run in trained},
        "thesis": THESIS.get(row.key),
        "scores": {
            level_name(level): {
                name: _scores(_entries(row, name, level, measured)) for name in measured.pictures
            }
            for level in LEVELS
        },
    }


def _entries(row: Row, set_name: str, level: float, measured: Measured) -> list[Entry]:
    runs = [run.name for run in row.runs if run.seed in measured.seeds[row.key]]
    return [measured.entries[run, set_name, level] for run in runs]


def _scores(entries: Sequence[Entry]) -> Record:
    return {
        "psnr_db": _summary([statistics.fmean(entry["psnr_db"]) for entry in entries]),
        "ssim": _summary([statistics.fmean(entry["ssim"]) for entry in entries]),
        "cpu_s": statistics.fmean(entry["cpu_s"] for entry in entries),
    }


def _summary(of_seeds: Sequence[float]) -> Record:
    return {
        "mean": statistics.fmean(of_seeds),
        "spread": statistics.stdev(of_seeds) if len(of_seeds) > 1 else None,
        "seeds": list(of_seeds),
    }


def _gain(one: Row, other: Row, measured: Measured) -> Record:
    return {
        level_name(level): {
            name: _gain_on(
                _entries(one, name, level, measured), _entries(other, name, level, measured)
            )
            for name in measured.pictures
        }
        for level in LEVELS
    }


def _gain_on(one: Sequence[Entry], other: Sequence[Entry]) -> Record:
    of_seeds = [[statistics.fmean(entry["psnr_db"]) for entry in row] for row in (one, other)]
    pictures = [a - b for a, b in zip(_of_pictures(one), _of_pictures(other), strict=True)]
    variances = [statistics.variance(row) for row in of_seeds if len(row) > 1]
    return {
        "db": statistics.fmean(pictures),
        "spread": math.sqrt(sum(variances)) if variances else None,
        "se_of_pictures": (
            statistics.stdev(pictures) / math.sqrt(len(pictures)) if len(pictures) > 1 else None
        ),
    }


def _of_pictures(entries: Sequence[Entry]) -> list[float]:
    """Return the PSNR of every picture, mean over seeds."""
    return [
        statistics.fmean(pictures)
        for pictures in zip(*(e["psnr_db"] for e in entries), strict=True)
    ]


def tables_text(record: Record) -> str:
    """Return the tables in Markdown: one for every level of light, then the gains."""
    levels = [_table(record, level) for level in record["photons"]]
    gains = [_gains(record)] if record["gains"] else []
    seeds = [
        f"- {key}: seeds {', '.join(map(str, seeds))} are not trained yet"
        for key, seeds in record["seeds_left_out"].items()
    ]
    rest = {key: value for key, value in record.items() if key != "seeds_left_out"}
    return "\n\n".join([*levels, *gains, "\n".join([REMARK, *seeds, *left_out_lines(rest)])]) + "\n"


def _table(record: Record, level: str) -> str:
    sets = list(record["pictures"])
    with_thesis = level == NOISE_FREE
    heads = ["row", *(TITLES.get(name, name) for name in sets)]
    if with_thesis:
        heads += [*(f"thesis: {TITLES.get(name, name)}" for name in sets), "kMAC/px"]
    cells = []
    for row in record["rows"].values():
        line = [row["label"], *(_score_text(row["scores"][level][name]) for name in sets)]
        if with_thesis:
            mac = row["mac_per_px"]
            line += [_printed(row["thesis"], name) for name in sets]
            line.append("" if mac is None else f"{mac / 1000:.4g}")
        cells.append(line)
    title = "no noise" if with_thesis else f"{level} photons of white"
    return f"**{title}** (PSNR in dB / SSIM)\n\n{markdown_table(heads, cells)}"


def _gains(record: Record) -> str:
    sets = list(record["pictures"])
    cells = [
        [name, level, *(_gain_text(values[of_set]) for of_set in sets)]
        for name, levels in record["gains"].items()
        for level, values in levels.items()
    ]
    return markdown_table(["gain, dB", "photons", *(TITLES.get(n, n) for n in sets)], cells)


def _score_text(values: Record) -> str:
    psnr, ssim = values["psnr_db"], values["ssim"]
    spread = "" if psnr["spread"] is None else f" +- {psnr['spread']:.2f}"
    return f"{psnr['mean']:.2f}{spread} / {ssim['mean']:.4f}"


def _gain_text(values: Record) -> str:
    spread = "" if values["spread"] is None else f" +- {values['spread']:.2f}"
    error = values["se_of_pictures"]
    pictures = "" if error is None else f" ({error:.2f})"
    return f"{values['db']:+.2f}{spread}{pictures}"


def _printed(thesis: Record | None, name: str) -> str:
    if thesis is None or name not in thesis:
        return ""
    found_db, ssim = thesis[name]
    return f"{found_db:.2f} / {ssim:.4f}"
