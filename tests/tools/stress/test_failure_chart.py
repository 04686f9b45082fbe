"""tools/stress/failure_chart.py: scenarios of a report in one picture, or one line."""

import json
from pathlib import Path

import cv2
import pytest

from tests.tiny_design import run_tool
from tools.stress.failure_chart import draw


def scenario(name: str, break_point: float | None) -> dict[str, object]:
    return {
        "scenario": name,
        "title": name,
        "knob": "scale",
        "unit": "%",
        "values": [-10.0, 0.0, 10.0],
        "psnr_db": {"filter": [20.0, 21.0, None], "M": [19.0, 23.0, 18.0]},
        "breaks": [{"method": "M", "side": "up", "break_point": break_point}],
    }


def test_a_panel_has_a_line_for_every_method_and_a_mark_where_one_breaks() -> None:
    panels = draw([scenario("broken", 7.0), scenario("sound", None)]).axes
    assert [len(panel.lines) for panel in panels] == [3, 2, 0]
    assert panels[0].lines[-1].get_xdata()[0] == 7.0
    assert panels[0].lines[-1].get_color() == panels[0].lines[1].get_color()


def test_a_method_looks_alike_in_every_panel() -> None:
    fewer = scenario("fewer", None)
    fewer["psnr_db"] = {"M": [1.0, 2.0, 3.0]}
    for order in ([scenario("all", None), fewer], [fewer, scenario("all", None)]):
        figure = draw(order)
        colors = [
            {line.get_label(): line.get_color() for line in panel.lines} for panel in figure.axes
        ]
        assert colors[0]["M"] == colors[1]["M"]
        (legend,) = figure.legends
        assert {text.get_text() for text in legend.get_texts()} == {"filter", "M"}


def test_a_report_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    report, out = tmp_path / "stress.json", tmp_path / "out.png"
    skipped = {"scenario": "skipped", "skipped": "no depths"}
    report.write_text(json.dumps([scenario("one", 3.0), skipped]), encoding="utf-8")
    run_tool(monkeypatch, "stress.failure_chart", report, "--scenarios", "one", "-o", out)
    assert cv2.imread(str(out)).std() > 5
    with pytest.raises(SystemExit, match=r"none\.json is no report of camkit stress"):
        run_tool(monkeypatch, "stress.failure_chart", "none.json", "-o", out, "--scenarios", "one")
    with pytest.raises(SystemExit, match="has no measured skipped, other"):
        run_tool(
            monkeypatch,
            "stress.failure_chart",
            report,
            "-o",
            out,
            "--scenarios",
            "skipped",
            "other",
        )
