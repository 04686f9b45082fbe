"""Tables of the page: accuracy by ISO and by place in the field, and how methods were tuned."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any, Final

from camkit.report.bench.row import Row
from camkit.report.bench.shown.field_panels import is_swept

Cell = Mapping[str, Any]
Tuned = Mapping[str, Any]
MEASURES: Final = (("psnr_db", ".2f"), ("ssim", ".3f"), ("hdr_psnr_db", ".2f"))
"""What a cell may show, with how many digits: the first two, or the third where they are not."""
TUNING_HEADS: Final = ("bundle", "method", "values", "from", "tuned on", "follows")
SPLIT_NOTE: Final = (
    "PSNR in dB / SSIM, means over pictures as in the table above; n captures. Places are shares "
    "of the way from the middle of the sensor to a corner, with the mean distance from the axis. "
    "Plain rows only: the variants are in bench.json."
)
GOLDEN_NOTE: Final = (
    " Not every picture was taken everywhere here, so columns differ in what they show too: "
    "compare methods within one."
)


def split_tables(report: Mapping[str, Any], camera: str) -> list[str]:
    """Return the accuracy of a camera's plain rows by ISO and by place; nothing without any."""
    rows = [r for r in report["rows"] if r["camera"] == camera and not r["variant"]]
    isos, places = _heads(rows, "by_iso", _iso_head), _heads(rows, "by_field", _place_head)
    if not isos and not places:
        return []
    heads = "".join(f"<th>{escape(text)}</th>" for text in ("method", *isos, *places))
    note = SPLIT_NOTE + ("" if is_swept(rows) else GOLDEN_NOTE)
    lines = [
        f"<h3>{escape(camera)} by ISO and by place in the field</h3>",
        f'<p class="small">{escape(note)}</p>',
        f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>',
    ]
    for row in rows:
        cells = [*_cells(row, "by_iso", isos, _iso_head)]
        cells += _cells(row, "by_field", places, _place_head)
        if any(cell is not None for cell in cells):
            name = escape(str(row["label"]))
            lines.append(f'<tr><td data-value="{name}">{name}</td>{"".join(map(_td, cells))}</tr>')
    lines.append("</tbody></table></div>")
    return lines


def _iso_head(cell: Cell) -> str:
    iso = "ISO unknown" if cell["iso"] is None else f"ISO {cell['iso']:g}"
    return f"{iso}, n = {cell['captures']}"


def _place_head(cell: Cell) -> str:
    if cell["field_share"] is None:
        return ""
    return f"{cell['field_share']:g} ({cell['field_mm']:.1f} mm), n = {cell['captures']}"


def _heads(rows: Iterable[Row], name: str, head: Any) -> list[str]:
    """Return heads of all cells of a split, in their order, those that are not known left out."""
    cells = sorted((c for row in rows for c in row.get(name, ())), key=_order)
    return [text for text in dict.fromkeys(map(head, cells)) if text]


def _order(cell: Cell) -> tuple[bool, float]:
    value = cell.get("iso", cell.get("field_share"))
    return value is None, value or 0.0


def _cells(row: Row, name: str, heads: Sequence[str], head: Any) -> list[Cell | None]:
    known = {head(cell): cell for cell in row.get(name, ())}
    return [known.get(text) for text in heads]


def _td(cell: Cell | None) -> str:
    shown = [] if cell is None else [(cell.get(key), form) for key, form in MEASURES]
    known = [(value, form) for value, form in shown if value is not None][:2]
    if not known:
        return '<td data-value="">-</td>'
    text = " / ".join(format(value, form) for value, form in known)
    return f'<td data-value="{known[0][0]}">{text}</td>'


def tuning_table(tuning: Iterable[Tuned]) -> list[str]:
    """Return how every method was tuned; nothing where nothing is known."""
    rows = list(tuning)
    if not rows:
        return []
    heads = "".join(f"<th>{escape(head)}</th>" for head in TUNING_HEADS)
    lines = ["<h2>How every method was tuned</h2>"]
    lines.append(f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>')
    for row in rows:
        values = ", ".join(f"{name} {_number(v)}" for name, v in row["values"].items()) or "-"
        name = str(row["size"] or row["method"])
        words = (values, row["source"], row["captures"], row["follows"] or "-")
        cells = [_words(text, "") for text in (row["bundle"], name)]
        cells += [_words(text, ' class="words"') for text in words]
        lines.append(f"<tr>{''.join(cells)}</tr>")
    lines.append("</tbody></table></div>")
    return lines


def _words(text: str, look: str) -> str:
    return f'<td{look} data-value="{escape(text)}">{escape(text)}</td>'


def _number(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
