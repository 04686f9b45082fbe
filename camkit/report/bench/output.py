"""A bench on the disk: bench.json, bench.csv, bench.svg, bench.png and bench.html."""

import csv
import json
from pathlib import Path
from typing import Any

from camkit.report.bench.row import Row
from camkit.report.bench.run import Result
from camkit.report.bench.shown.bench_chart import draw_chart
from camkit.report.bench.shown.bench_page import bench_page
from camkit.report.figure import to_png, to_svg
from camkit.report.pages.page import to_html

NAME = "bench"


def write_bench(result: Result, folder: Path) -> list[Path]:
    """Write everything; an earlier bench in the folder is replaced.

    Returns:
        The files; without matplotlib or without PSNR there is no chart, and of kinds that measure
        themselves neither chart nor page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = {
        suffix: folder / f"{NAME}.{suffix}" for suffix in ("json", "csv", "svg", "png", "html")
    }
    text = json.dumps(result.report, indent=1, allow_nan=False)
    paths["json"].write_text(text + "\n", encoding="utf-8")
    write_csv(paths["csv"], result.report["rows"])
    contents: dict[str, bytes] = {}
    if not result.self_measured:
        figure = draw_chart(result.report)
        svg = None if figure is None else to_svg(figure)
        if figure is not None and svg is not None:
            contents = {"svg": svg.encode(), "png": to_png(figure)}
        contents["html"] = to_html(bench_page(result, svg)).encode()
    for suffix in ("svg", "png", "html"):
        if suffix in contents:
            paths[suffix].write_bytes(contents[suffix])
        else:
            paths.pop(suffix).unlink(missing_ok=True)
    return list(paths.values())


def write_csv(path: Path, rows: list[Row]) -> None:
    """Write one line per row, the seconds of every stage in columns of their own."""
    flat = [flatten(row) for row in rows]
    names = list(dict.fromkeys(name for row in flat for name in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        writer.writerows(flat)


def flatten(row: Row) -> dict[str, Any]:
    """Return a row without nesting: `stages` becomes columns `stage_NAME_s`; the other parts go."""
    flat = {name: value for name, value in row.items() if not isinstance(value, dict | list)}
    return flat | {f"stage_{name}_s": value for name, value in row.get("stages", {}).items()}
