"""Chart, page, CSV and JSON of a report made by hand."""

import csv
import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import cv2
import pytest

from camkit.report.bench.accuracy import INPUT
from camkit.report.bench.crops import SHARP, Patch
from camkit.report.bench.output import write_bench
from camkit.report.bench.row import make_row
from camkit.report.bench.run import Result
from camkit.report.bench.shown.bench_page import bench_page
from camkit.report.bench.shown.front_panel import plottable
from camkit.report.pages.page import PNG_START, to_html
from tests.bench_factory import make_facts, make_run, make_scores, make_trial

NAMES = ("S", "M <b>", "wiener")


@pytest.fixture(scope="module")
def result() -> Result:
    trials = [
        make_trial(size="S"),
        make_trial(size="M <b>"),
        make_trial(size="S", threads=1),
        make_trial(
            size=None, mode=None, dtype=None, provider=None, maker="classical", method="wiener"
        ),
    ]
    gains = [5.0, 6.0, 5.0, 3.0]
    scores = {
        trial.accuracy_key: make_scores({"a": 19.0 + gain, "b": 21.0 + gain})
        for trial, gain in zip(trials, gains, strict=True)
    }
    scores[INPUT] = make_scores({"a": 19.0, "b": 20.0})
    rows = [
        make_row(trial, [make_run(2.0 + i), make_run(2.1 + i)], make_facts(scores=scores))
        for i, trial in enumerate(trials)
    ]
    pixel = PNG_START + b"pixel"
    patch = Patch(
        caption="golden & case",
        pictures={SHARP: pixel, INPUT: pixel, trials[0].accuracy_key: pixel},
        psnr_db={INPUT: 20.0, trials[0].accuracy_key: 25.5},
    )
    report: dict[str, Any] = {
        "report_version": 1,
        "machine": {
            "processor": "p",
            "memory_mb": None,
            "cpu_flags": ["avx2"],
            "packages": {"a": "1"},
        },
        "repeat": 2,
        "cameras": {
            "duet": {
                "width": 4000,
                "height": 3000,
                "capture": "a scene",
                "accuracy": "2 pictures",
                "bundle_sha256": "ab" * 32,
            }
        },
        "rows": rows,
        "skipped": [{"what": "M cuda", "reason": "onnxruntime here computes on cpu"}],
    }
    return Result(
        report=report,
        patches={"duet": [patch]},
        names={trial.accuracy_key: trial.label for trial in reversed(trials)},
    )


def test_everything_is_written_and_reads_back(result: Result, tmp_path: Path) -> None:
    files = {path.suffix: path for path in write_bench(result, tmp_path / "new")}
    assert json.loads(files[".json"].read_text()) == result.report
    with files[".csv"].open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["label"] for line in lines] == [row["label"] for row in result.report["rows"]]
    assert float(lines[0]["stage_network_s"]) == pytest.approx(1.025)
    assert lines[0]["seconds_p99"] == ""
    picture = cv2.imread(str(files[".png"]))
    assert min(picture.shape[:2]) > 600
    assert (picture < 128).any()
    texts = "".join(ET.parse(files[".svg"]).getroot().itertext())
    for word in (*NAMES, "PSNR, dB", "Pareto front", "input 19.50 dB", "S 1 thread"):
        assert word in texts


def test_without_accuracy_there_is_no_chart_and_an_old_one_goes(
    result: Result, tmp_path: Path
) -> None:
    rows = [row | {"psnr_db": None} for row in result.report["rows"]]
    (tmp_path / "bench.png").touch()
    files = write_bench(Result(report=result.report | {"rows": rows}), tmp_path)
    assert {path.suffix for path in files} == {".json", ".csv", ".html"}
    assert not (tmp_path / "bench.png").exists()
    assert "No chart" in (tmp_path / "bench.html").read_text()


def test_rows_without_seconds_are_not_plotted(result: Result) -> None:
    rows = result.report["rows"]
    assert plottable([rows[0], rows[1] | {"seconds_median": None}], "duet") == [rows[0]]
    assert plottable(rows, "other") == []


def test_the_page_needs_no_other_file(result: Result) -> None:
    page = to_html(bench_page(result, "<svg/>"))
    assert not re.search(r"https?:|//[a-z]|@import|<link|url\(", page)
    sources = re.findall(r'src=["\']([^"\']*)', page)
    assert len(sources) == 4  # the chart and three patches
    assert all(source.startswith("data:image/") for source in sources)


def test_the_page_shows_rows_patches_machine_and_what_is_missing(result: Result) -> None:
    page = to_html(bench_page(result, None))
    table = page.split("<table>", 2)[1]
    assert table.count("<tr") == 1 + len(result.report["rows"])
    assert "M &lt;b&gt;" in page
    assert "M <b>" not in page
    for words in ("golden &amp; case", "S, 25.50 dB", "input, 20.00 dB", "M cuda: onnxruntime"):
        assert words in page
    assert '<td>memory_mb</td><td class="words">unknown</td>' in page
    assert "Best of duet: M &lt;b&gt; with 26.00 dB in 3.05 s, +6.50 dB over the input" in page
    assert "Best classical method: wiener with 23.00 dB in 5.05 s." in page


def test_numbers_sort_by_value_and_unknown_ones_last(result: Result) -> None:
    rows = [result.report["rows"][0] | {"psnr_db": None, "seconds_median": 10.5}]
    page = to_html(bench_page(Result(report=result.report | {"rows": rows}), None))
    assert '<td data-value="10.5">10.50</td>' in page
    assert "<td>-</td>" in page
