"""The record as tables, one for each group of scenes."""

from collections.abc import Iterator
from typing import Any, Final

from tools.hdr.table.record import GAIN, OVER_BARE, is_input
from tools.hdr.table.scenes import GROUPS

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


def tables_text(record: Record) -> str:
    """Return the tables in Markdown."""
    parts = [_table(record, group) for group in record["groups"]]
    return "\n\n".join([*parts, "\n".join(_remarks(record))]) + "\n"


def _table(record: Record, group: str) -> str:
    scenes, rows = record["groups"][group], record["rows"]
    there = [n for n in HEADS if any(n in row["groups"][group] for row in rows.values())]
    lines = [
        f"**{GROUPS[group]}** ({len(scenes)})",
        "",
        " | ".join(["| row", *(HEADS[name] for name in there)]) + " |",
        "|---" * (len(there) + 1) + "|",
    ]
    for key, row in rows.items():
        cells = [_cell(name, row["groups"][group].get(name), is_input(key)) for name in there]
        lines.append(" | ".join([f"| {row['label']}", *cells]) + " |")
    return "\n".join(lines)


def _cell(name: str, found: Record | None, of_input: bool) -> str:
    if found is None or (of_input and name in {GAIN, OVER_BARE}):
        return ""
    digits = DIGITS.get(name, 1)
    sign = "+" if name in {GAIN, OVER_BARE} else ""
    text = f"{found['mean']:{sign}.{digits}f}"
    spread = found["std_of_seeds"]
    return text if spread is None else f"{text} +- {spread:.{max(digits, 2)}f}"


def _remarks(record: Record) -> Iterator[str]:
    yield "Means over scenes; +- is the standard deviation over seeds of training."
    for key, row in record["rows"].items():
        if row["below_input"] and not is_input(key):
            yield (
                f"- {row['label']}: below the lesser of LDR - 0.5 and 65 dB on "
                f"{', '.join(row['below_input'])}"
            )
    for key, reason in record["rows_left_out"].items():
        yield f"- {key} is left out: {reason}"
    for name, reason in record["scenes_left_out"].items():
        yield f"- {name} is left out: {reason}"
