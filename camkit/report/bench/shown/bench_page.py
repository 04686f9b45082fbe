"""The page of a bench: chart, every row, accuracy by ISO and place, the same patch of methods."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from camkit.report.bench.accuracy import INPUT, Key
from camkit.report.bench.crops import SHARP, Patch
from camkit.report.bench.pareto import pareto_front
from camkit.report.bench.row import Row
from camkit.report.bench.run import Result
from camkit.report.bench.shown.bench_chart import is_swept
from camkit.report.bench.timed.timing import LEAST_N_OF_P99, NOISY_LOAD, NOISY_SPREAD
from camkit.report.pages.page import Cell, Page, Part, Picture, Section, Table, Words


class TableColumn(NamedTuple):
    """A column of the table: head, key of the row, format of a number, what it means."""

    head: str
    key: str
    form: str
    meaning: str


COLUMNS: Final = (
    TableColumn("method", "label", "", "a size of network, or the name of a method"),
    TableColumn("PSNR dB", "psnr_db", ".2f", "mean over pictures, on sRGB values"),
    TableColumn("SSIM", "ssim", ".3f", "mean over pictures, on sRGB values"),
    TableColumn("MTF 0.25", "mtf_025", ".2f", "of an edge on the axis, at 0.25 cycles per pixel"),
    TableColumn("MTF 0.5", "mtf_050", ".2f", "likewise at 0.5, the finest that pixels can show"),
    TableColumn(
        "over base dB", "over_base_psnr_db", "+.2f", "mean over pictures of the gain over size M"
    ),
    TableColumn("+-", "over_base_se_psnr_db", ".2f", "standard error of that gain over pictures"),
    TableColumn("s", "seconds_median", ".2f", "median, file to EXR in a fresh process"),
    TableColumn(
        "p90 s", "seconds_p90", ".2f", "0.9 quantile, interpolated where processes are few"
    ),
    TableColumn("min s", "seconds_min", ".2f", "the fastest process"),
    TableColumn("n", "n", "d", "processes measured"),
    TableColumn("ratio", "seconds_ratio", ".2f", "seconds over those of size M, by rounds"),
    TableColumn("steady s", "steady_seconds_median", ".2f", "the next file in the same process"),
    TableColumn(
        "CPU s", "cpu_seconds_median", ".2f", "processor time of the first file, all threads"
    ),
    TableColumn("MP/s", "mp_per_s", ".2f", "megapixels per second, from the median"),
    TableColumn("s per 24 MP", "s_per_24mp", ".1f", "the median scaled to 24 megapixels"),
    TableColumn("peak MB", "peak_rss_mb", ".0f", "memory of the process and its children"),
    TableColumn("MAC/px", "mac_per_px", ".0f", "multiply-adds of the network per pixel"),
    TableColumn("of GEMM", "share_of_gemm_peak", ".0%", "network speed over the matrix product's"),
    TableColumn("threads", "threads", "d", "threads in all"),
    TableColumn("noisy", "noisy", "", "the seconds are not to be trusted to a few per cent"),
)

HDR_COLUMNS: Final = (
    TableColumn("HDR dB", "hdr_psnr_db", ".2f", "mean over pictures, linear, with its peak at 2^8"),
    TableColumn("stops", "stops_rmse", ".2f", "RMS of log2 above white, mean over pictures"),
    TableColumn("unclipped dB", "unclipped_psnr_db", ".2f", "where the capture is not clipped"),
)
"""Where a camera is judged by high dynamic range."""

TIE_DB: Final = 0.05
"""Differences below are not worth time."""

MEASURES: Final = (("psnr_db", ".2f"), ("ssim", ".3f"), ("hdr_psnr_db", ".2f"))
"""What a place may show, with how many digits: the first two, or the third where they are not."""
SPLIT_NOTE: Final = (
    "PSNR in dB / SSIM, means over pictures as in the table above; n captures. Places are shares "
    "of the way from the middle of the sensor to a corner, with the mean distance from the axis. "
    "Plain rows only: the variants are in bench.json."
)
GOLDEN_NOTE: Final = (
    " Not every picture was taken everywhere here, so columns differ in what they show too: "
    "compare methods within one."
)
NOISE_NOTE: Final = (
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
NO_CHART: Final = "No chart: it needs accuracy."

Group = Mapping[str, Any]
"""The captures of one ISO or place, see `camkit.report.bench.split`."""


def bench_page(result: Result, chart_svg: str | None) -> Page:
    """Return the page.

    Args:
        result: The bench.
        chart_svg: The chart; None if there is none.
    """
    report = result.report
    chart = Words(NO_CHART, "small") if chart_svg is None else Picture("", chart_svg)
    sections = []
    for camera in report["cameras"]:
        sections += [_rows(report, camera), split_section(report, camera)]
        sections.append(_patches(result.patches.get(camera, []), _labels(result, camera)))
    sections += [tuning_section(report.get("tuning", ())), _skipped(report["skipped"])]
    sections += [_machine(report), _reading()]
    return Page(
        title=f"camkit bench: {', '.join(report['cameras'])}",
        lead=[*(summary(report, camera) for camera in report["cameras"]), chart],
        sections=[section for section in sections if section is not None],
    )


def summary(report: dict[str, Any], camera: str) -> str:
    """Describe in a sentence or two what a camera's rows show."""
    rows = [row for row in report["rows"] if row["camera"] == camera]
    facts = report["cameras"][camera]
    scored = [row for row in rows if row.get("psnr_db") is not None and row["kind"] != "develop"]
    bundle_rows = [row for row in scored if row["bundle"] == camera]
    text = (
        f"Captures of {facts['width']} x {facts['height']} px ({facts['capture']}); accuracy on "
        f"{facts['accuracy']}. Bundle {facts['bundle_sha256'][:12]}."
    )
    if not bundle_rows:
        return text
    best = max(bundle_rows, key=lambda row: row["psnr_db"])
    text += f" Best of {camera}: {_in_words(best)}"
    if best["input_psnr_db"] is not None:
        text += f", {best['psnr_db'] - best['input_psnr_db']:+.2f} dB over the input"
    near = [
        r
        for r in bundle_rows
        if _psnr(r) > _psnr(best) - TIE_DB and r["seconds_median"] is not None
    ]
    fastest = min(near, key=lambda row: float(row["seconds_median"]), default=best)
    if fastest is not best:
        text += f". The fastest within {TIE_DB:g} dB of it: {_in_words(fastest)}"
    classical = [row for row in bundle_rows if row["kind"] == "classical" and row is not best]
    if classical:
        text += f". Best classical method: {_in_words(max(classical, key=_psnr))}"
    return text + "."


def _psnr(row: Row) -> float:
    return float(row["psnr_db"])


def _in_words(row: Row) -> str:
    seconds = row["seconds_median"]
    time = "not timed" if seconds is None else f"{seconds:.2f} s"
    return f"{row['label']} with {row['psnr_db']:.2f} dB in {time}"


def _rows(report: dict[str, Any], camera: str) -> Section:
    rows = [row for row in report["rows"] if row["camera"] == camera]
    timed = [r for r in rows if r["seconds_median"] is not None and r.get("psnr_db") is not None]
    points = [(r["seconds_median"], r["psnr_db"]) for r in timed]
    front = {id(timed[index]) for index in pareto_front(points)}
    is_hdr = any(HDR_COLUMNS[0].key in row for row in rows)
    columns = (COLUMNS[0], *HDR_COLUMNS, *COLUMNS[1:]) if is_hdr else COLUMNS
    cells = []
    for row in rows:
        name, *numbers = (_cell(row, column) for column in columns)
        best = Cell(text=row["label"], look="best")
        cells.append([best if id(row) in front else name, *numbers])
    heads, meanings = zip(*((column.head, column.meaning) for column in columns), strict=True)
    table = Table(header=heads, rows=cells, meanings=meanings)
    words = Words("Click a head to sort. Bold: nothing is both faster and better.", "small")
    failed = [Words(f"{row['label']}: {row['error']}", "bad") for row in rows if row["error"]]
    return Section(f"{camera}: every row", (words, table, *failed))


def _cell(row: Row, column: TableColumn) -> str | Cell:
    value = row.get(column.key)
    if value is None:
        return "-"
    if isinstance(value, bool):
        return Cell(text="yes" if value else "no", value=int(value), look="bad" if value else "")
    return Cell(text=format(value, column.form), value=value)


def split_section(report: Mapping[str, Any], camera: str) -> Section | None:
    """Return the accuracy of a camera's plain rows by ISO and by place; None without any."""
    rows = [r for r in report["rows"] if r["camera"] == camera and not r["variant"]]
    split = {"by_iso": _iso_head, "by_field": _place_head}
    heads = {name: _heads(rows, name, head) for name, head in split.items()}
    if not any(heads.values()):
        return None
    table: list[list[str | Cell]] = []
    for row in rows:
        groups = [
            {head(group): group for group in row.get(name, ())}.get(text)
            for name, head in split.items()
            for text in heads[name]
        ]
        if any(group is not None for group in groups):
            table.append([str(row["label"]), *map(_accuracy, groups)])
    note = Words(SPLIT_NOTE + ("" if is_swept(rows) else GOLDEN_NOTE), "small")
    header = ("method", *heads["by_iso"], *heads["by_field"])
    title = f"{camera} by ISO and by place in the field"
    return Section(title, (note, Table(header=header, rows=table)))


def _iso_head(group: Group) -> str:
    iso = "ISO unknown" if group["iso"] is None else f"ISO {group['iso']:g}"
    return f"{iso}, n = {group['captures']}"


def _place_head(group: Group) -> str:
    if group["field_share"] is None:
        return ""
    return f"{group['field_share']:g} ({group['field_mm']:.1f} mm), n = {group['captures']}"


def _heads(rows: Iterable[Row], name: str, head: Callable[[Group], str]) -> list[str]:
    """Return heads of all groups of a split, in their order, those that are not known left out."""

    def order(group: Group) -> tuple[bool, float]:
        value = group.get("iso", group.get("field_share"))
        return value is None, value or 0.0

    groups = sorted((group for row in rows for group in row.get(name, ())), key=order)
    return [text for text in dict.fromkeys(map(head, groups)) if text]


def _accuracy(group: Group | None) -> str | Cell:
    pairs = [] if group is None else [(group.get(key), form) for key, form in MEASURES]
    measures = [(value, form) for value, form in pairs if value is not None][:2]
    if not measures:
        return "-"
    return Cell(text=" / ".join(format(v, form) for v, form in measures), value=measures[0][0])


def tuning_section(tuning: Iterable[Mapping[str, Any]]) -> Section | None:
    """Return how every method was tuned; None where nothing is known."""
    rows = [
        (
            row["bundle"],
            str(row["size"] or row["method"]),
            *(Cell(text=text, look="words") for text in _tuning_words(row)),
        )
        for row in tuning
    ]
    table = Table(header=("bundle", "method", "values", "from", "tuned on", "follows"), rows=rows)
    return Section("How every method was tuned", (table,)) if rows else None


def _tuning_words(row: Mapping[str, Any]) -> tuple[str, ...]:
    numbers = {n: f"{v:g}" if isinstance(v, float) else str(v) for n, v in row["values"].items()}
    values = ", ".join(f"{name} {number}" for name, number in numbers.items())
    return values or "-", row["source"], row["captures"], row["follows"] or "-"


def _labels(result: Result, camera: str) -> dict[Key, str]:
    fixed: dict[Key, str] = {SHARP: "sharp", INPUT: "input"}
    return fixed | {key: name for key, name in result.names.items() if key[0] == camera}


def _patches(patches: Sequence[Patch], labels: dict[Key, str]) -> Section | None:
    parts: list[Part] = []
    for patch in patches:
        parts.append(Words(patch.caption, "head"))
        for key, picture in patch.pictures.items():
            label, psnr = labels.get(key, str(key)), patch.psnr_db.get(key)
            text = label if psnr is None else f"{label}, {psnr:.2f} dB"
            parts.append(Picture(text, picture, is_patch=True))
    return Section("The same patch by every method", parts) if parts else None


def _skipped(skipped: Sequence[dict[str, str]]) -> Section | None:
    words = [f"{skip['what']}: {skip['reason']}" for skip in skipped]
    return Section("Not measured", words) if words else None


def _machine(report: dict[str, Any]) -> Section:
    facts = {**report["machine"], "processes per row": report["repeat"]}
    rows = [(name, Cell(text=_flat(value), look="words")) for name, value in facts.items()]
    return Section("Machine", (Table(rows=rows),))


def _flat(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k} {v}" for k, v in value.items() if v is not None)
    if isinstance(value, list):
        return " ".join(map(str, value))
    return "unknown" if value is None else str(value)


def _reading() -> Section:
    rows = [(column.head, Cell(text=column.meaning, look="words")) for column in COLUMNS]
    return Section("How to read this", (Table(rows=rows), Words(NOISE_NOTE, "small")))
