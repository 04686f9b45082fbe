"""The page: chart, sortable table, the same patch of every method; one file, no other needed."""

from collections.abc import Sequence
from html import escape
from typing import Any, Final, NamedTuple

from camkit.report.bench.accuracy import INPUT, Key
from camkit.report.bench.crops import SHARP, Patch
from camkit.report.bench.pareto import pareto_front
from camkit.report.bench.row import Row
from camkit.report.bench.run import Result
from camkit.report.bench.shown.tables import split_tables, tuning_table
from camkit.report.bench.timed.timing import LEAST_N_OF_P99, NOISY_LOAD, NOISY_SPREAD


class Shown(NamedTuple):
    """A column of the table: head, key of the row, format of a number, what it means."""

    head: str
    key: str
    form: str
    meaning: str


COLUMNS: Final = (
    Shown("method", "label", "", "a size of network, or the name of a method"),
    Shown("PSNR dB", "psnr_db", ".2f", "mean over pictures, on sRGB values"),
    Shown("SSIM", "ssim", ".3f", "mean over pictures, on sRGB values"),
    Shown("MTF 0.25", "mtf_025", ".2f", "of an edge on the axis, at 0.25 cycles per pixel"),
    Shown("MTF 0.5", "mtf_050", ".2f", "likewise at 0.5, the finest that pixels can show"),
    Shown(
        "over base dB", "over_base_psnr_db", "+.2f", "mean over pictures of the gain over size M"
    ),
    Shown("+-", "over_base_se_psnr_db", ".2f", "standard error of that gain over pictures"),
    Shown("s", "seconds_median", ".2f", "median, file to EXR in a fresh process"),
    Shown("p90 s", "seconds_p90", ".2f", "0.9 quantile, interpolated where processes are few"),
    Shown("min s", "seconds_min", ".2f", "the fastest process"),
    Shown("n", "n", "d", "processes measured"),
    Shown("ratio", "seconds_ratio", ".2f", "seconds over those of size M, by rounds"),
    Shown("steady s", "steady_seconds_median", ".2f", "the next file in the same process"),
    Shown("CPU s", "cpu_seconds_median", ".2f", "processor time of the first file, all threads"),
    Shown("MP/s", "mp_per_s", ".2f", "megapixels per second, from the median"),
    Shown("s per 24 MP", "s_per_24mp", ".1f", "the median scaled to 24 megapixels"),
    Shown("peak MB", "peak_rss_mb", ".0f", "memory of the process and its children"),
    Shown("MAC/px", "mac_per_px", ".0f", "multiply-adds of the network per pixel"),
    Shown("of GEMM", "share_of_gemm_peak", ".0%", "network speed over the matrix product's"),
    Shown("threads", "threads", "d", "threads in all"),
    Shown("noisy", "noisy", "", "the seconds are not to be trusted to a few per cent"),
)

HDR_COLUMNS: Final = (
    Shown("HDR dB", "hdr_psnr_db", ".2f", "mean over pictures, linear, with its peak at 2^8"),
    Shown("stops", "stops_rmse", ".2f", "RMS of log2 above white, mean over pictures"),
    Shown("unclipped dB", "unclipped_psnr_db", ".2f", "where the capture is not clipped"),
)
"""Where a camera is judged by high dynamic range."""

TIE_DB: Final = 0.05
"""Differences below are not worth time."""

STYLE: Final = """
body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:76rem;padding:0 1rem;color:#222}
h1{font-size:1.6rem}h2{margin-top:2.2rem;font-size:1.25rem}
table{border-collapse:collapse;font-size:13px}
.scroll{overflow-x:auto}
th,td{padding:.25rem .55rem;text-align:right;border-bottom:1px solid #ddd;white-space:nowrap}
th:first-child,td:first-child{text-align:left}
th{cursor:pointer;background:#f3f3f3;user-select:none}
th[aria-sort=ascending]::after{content:" \\25B2"}th[aria-sort=descending]::after{content:" \\25BC"}
tr.front td:first-child{font-weight:bold}
td.bad{color:#b3421a}
td.words{white-space:normal;text-align:left;min-width:12rem;vertical-align:top}
.patches{display:flex;flex-wrap:wrap;gap:.8rem}
figure{margin:0;width:192px}figure img{width:192px;height:192px;image-rendering:pixelated}
figcaption{font-size:12px;line-height:1.3}
img.chart{max-width:100%}
dl{display:grid;grid-template-columns:max-content auto;gap:.1rem 1rem;font-size:13px}
dt{color:#666}dd{margin:0}
.small{font-size:13px;color:#555}
"""

SCRIPT: Final = """
for (const head of document.querySelectorAll("th")) {
  head.onclick = () => {
    const table = head.closest("table"), body = table.tBodies[0];
    const up = head.getAttribute("aria-sort") !== "ascending";
    for (const other of table.querySelectorAll("th")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    const value = row => row.cells[head.cellIndex].dataset.value;
    const order = (a, b) => {
      const x = value(a), y = value(b);
      if (x === "" || y === "") return (x === "") - (y === "");
      const number = Number(x) - Number(y);
      return (Number.isNaN(number) ? x.localeCompare(y) : number) * (up ? 1 : -1);
    };
    body.append(...[...body.rows].sort(order));
  };
}
"""


def to_html(result: Result, chart_svg_base64: str | None) -> str:
    """Return the page.

    Args:
        result: The bench.
        chart_svg_base64: The chart; None if there is none.
    """
    report = result.report
    names = ", ".join(report["cameras"])
    parts = [
        f"<h1>camkit bench: {escape(names)}</h1>",
        *(f"<p>{escape(summary(report, camera))}</p>" for camera in report["cameras"]),
    ]
    if chart_svg_base64 is None:
        parts.append('<p class="small">No chart: it needs accuracy, and matplotlib installed.</p>')
    else:
        source = f"data:image/svg+xml;base64,{chart_svg_base64}"
        parts.append(f'<img class="chart" alt="seconds against PSNR" src="{source}">')
    for camera in report["cameras"]:
        parts += _table(report, camera)
        parts += split_tables(report, camera)
        parts += _patches(result.patches.get(camera, []), _labels(result, camera))
    parts += tuning_table(report.get("tuning", ()))
    parts += _skipped(report["skipped"])
    parts += _machine(report)
    parts += _reading()
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>camkit bench: {escape(names)}</title><style>{STYLE}</style></head>\n<body>"
        + "\n".join(parts)
        + f"\n<script>{SCRIPT}</script></body></html>\n"
    )


def summary(report: dict[str, Any], camera: str) -> str:
    """Say in a sentence or two what a camera's rows show."""
    rows = [row for row in report["rows"] if row["camera"] == camera]
    facts = report["cameras"][camera]
    scored = [row for row in rows if row.get("psnr_db") is not None and row["kind"] != "develop"]
    own = [row for row in scored if row["bundle"] == camera]
    text = (
        f"Captures of {facts['width']} x {facts['height']} px ({facts['capture']}); accuracy on "
        f"{facts['accuracy']}. Bundle {facts['bundle_sha256'][:12]}."
    )
    if not own:
        return text
    best = max(own, key=lambda row: row["psnr_db"])
    text += f" Best of {camera}: {_in_words(best)}"
    if best["input_psnr_db"] is not None:
        text += f", {best['psnr_db'] - best['input_psnr_db']:+.2f} dB over the input"
    near = [r for r in own if _psnr(r) > _psnr(best) - TIE_DB and r["seconds_median"] is not None]
    fastest = min(near, key=lambda row: float(row["seconds_median"]), default=best)
    if fastest is not best:
        text += f". The fastest within {TIE_DB:g} dB of it: {_in_words(fastest)}"
    classical = [row for row in own if row["kind"] == "classical" and row is not best]
    if classical:
        text += f". Best classical method: {_in_words(max(classical, key=_psnr))}"
    return text + "."


def _psnr(row: Row) -> float:
    return float(row["psnr_db"])


def _in_words(row: Row) -> str:
    seconds = row["seconds_median"]
    time = "not timed" if seconds is None else f"{seconds:.2f} s"
    return f"{row['label']} with {row['psnr_db']:.2f} dB in {time}"


def _table(report: dict[str, Any], camera: str) -> list[str]:
    rows = [row for row in report["rows"] if row["camera"] == camera]
    timed = [r for r in rows if r["seconds_median"] is not None and r.get("psnr_db") is not None]
    points = [(r["seconds_median"], r["psnr_db"]) for r in timed]
    front = {id(timed[index]) for index in pareto_front(points)}
    is_hdr = any(HDR_COLUMNS[0].key in row for row in rows)
    columns = (COLUMNS[0], *HDR_COLUMNS, *COLUMNS[1:]) if is_hdr else COLUMNS
    heads = "".join(f'<th title="{escape(c.meaning)}">{escape(c.head)}</th>' for c in columns)
    lines = [f"<h2>{escape(camera)}: every row</h2>"]
    lines.append(
        '<p class="small">Click a head to sort. Bold: nothing is both faster and better.</p>'
    )
    lines.append(f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>')
    for row in rows:
        mark = ' class="front"' if id(row) in front else ""
        cells = "".join(_cell(row, column) for column in columns)
        lines.append(f"<tr{mark}>{cells}</tr>")
    lines.append("</tbody></table></div>")
    failed = [row for row in rows if row["error"]]
    lines += [
        f'<p class="bad">{escape(row["label"])}: {escape(row["error"])}</p>' for row in failed
    ]
    return lines


def _cell(row: Row, column: Shown) -> str:
    value = row.get(column.key)
    if value is None:
        return '<td data-value="">-</td>'
    if isinstance(value, bool):
        mark = ' class="bad"' if value else ""
        return f'<td{mark} data-value="{int(value)}">{"yes" if value else "no"}</td>'
    text = format(value, column.form)
    return f'<td data-value="{escape(str(value))}">{escape(text)}</td>'


def _labels(result: Result, camera: str) -> dict[Key, str]:
    fixed: dict[Key, str] = {SHARP: "sharp", INPUT: "input"}
    return fixed | {key: name for key, name in result.names.items() if key[0] == camera}


def _patches(patches: Sequence[Patch], labels: dict[Key, str]) -> list[str]:
    lines = ["<h2>The same patch by every method</h2>"] if patches else []
    for patch in patches:
        lines.append(f"<h3>{escape(patch.caption)}</h3><div class='patches'>")
        for key, picture in patch.pictures.items():
            label = labels.get(key, str(key))
            psnr = patch.psnr_db.get(key)
            text = label if psnr is None else f"{label}, {psnr:.2f} dB"
            lines.append(
                f'<figure><img alt="{escape(label)}" src="data:image/png;base64,{picture}">'
                f"<figcaption>{escape(text)}</figcaption></figure>"
            )
        lines.append("</div>")
    return lines


def _skipped(skipped: Sequence[dict[str, str]]) -> list[str]:
    if not skipped:
        return []
    items = "".join(f"<li>{escape(s['what'])}: {escape(s['reason'])}</li>" for s in skipped)
    return [f"<h2>Not measured</h2><ul>{items}</ul>"]


def _machine(report: dict[str, Any]) -> list[str]:
    facts = {**report["machine"], "processes per row": report["repeat"]}
    items = []
    for name, value in facts.items():
        items.append(f"<dt>{escape(name)}</dt><dd>{escape(_flat(value))}</dd>")
    return [f"<h2>Machine</h2><dl>{''.join(items)}</dl>"]


def _flat(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k} {v}" for k, v in value.items() if v is not None)
    if isinstance(value, list):
        return " ".join(map(str, value))
    return "unknown" if value is None else str(value)


def _reading() -> list[str]:
    meanings = "".join(f"<dt>{escape(c.head)}</dt><dd>{escape(c.meaning)}</dd>" for c in COLUMNS)
    noise = (
        f"A row is noisy if p90 lies more than {NOISY_SPREAD - 1:.0%} above the median, or if "
        f"others took more than {NOISY_LOAD:.0%} of the machine's processor time meanwhile. "
        f"A 0.99 quantile is given from {LEAST_N_OF_P99} processes on. The rows of a round are "
        "measured one after the other, rounds forwards and backwards in turn. A CPU computes fp16 "
        "graphs in fp32. Mode fast cuts the halo of a tile short, whole takes the picture as one "
        "tile; captures that accuracy is measured on fit into one tile, so what fast costs is not "
        "seen here but stated in the bundle's manifest. Where a bundle has no size M, its first "
        "row stands for it. Patches are the busiest of their captures, so their PSNR lies below "
        "the mean."
    )
    return [f'<h2>How to read this</h2><dl>{meanings}</dl><p class="small">{escape(noise)}</p>']
