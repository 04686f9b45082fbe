"""The chart: all cameras on common axes, a colour each; a marker for every method."""

from typing import Any
from xml.etree import ElementTree as ET

import pytest
from matplotlib.figure import Figure

from camkit.report.bench.row import Row, make_row
from camkit.report.bench.shown.bench_chart import (
    draw_chart,
    draw_field_panel,
    field_isos,
    shown_rows,
)
from camkit.report.bench.shown.bench_page import split_section, tuning_section
from camkit.report.bench.shown.front_panel import (
    NOT_COMPARABLE,
    draw_front_panel,
    label_front_panel,
    title,
)
from camkit.report.bench.shown.looks import CAMERA_COLORS, looks_of, method_name, seconds_per_mp
from camkit.report.figure import to_svg
from camkit.report.pages.page import Page, Section, to_html
from tests.bench_factory import make_facts, make_run, make_trial

CAMERAS = ("duet", "trio")
PLAIN = {"size": None, "mode": None, "dtype": None, "provider": None}


def cells(level: float, isos: tuple[float, ...] = (100.0, 1600.0)) -> list[dict[str, Any]]:
    return [
        {
            "iso": iso,
            "field_share": share,
            "field_mm": 20 * share,
            "captures": 3,
            "images": 3,
            "psnr_db": level - 2 * share - (iso > 200),
            "input_psnr_db": 15.0,
            "ssim": 0.5,
        }
        for iso in isos
        for share in (0.0, 0.5, 1.0)
    ]


def make_rows(camera: str, level: float) -> list[Row]:
    trials = [
        make_trial(camera=camera, bundle=camera, size="S"),
        make_trial(camera=camera, bundle=camera, size="M"),
        make_trial(camera=camera, bundle=camera, size="M", threads=1),
        make_trial(camera=camera, bundle=camera, maker="classical", method="wiener", **PLAIN),
        make_trial(camera=camera, bundle=camera, maker="classical", method="rl", **PLAIN),
        make_trial(camera=camera, bundle=camera, maker="develop", method="develop", **PLAIN),
    ]
    gains = (5.0, 6.0, 6.0, 2.0, 3.0, 0.0)
    rows = []
    for number, (trial, gain) in enumerate(zip(trials, gains, strict=True)):
        row = make_row(trial, [make_run(2.0 + number)], make_facts())
        psnr = {"psnr_db": level + gain, "input_psnr_db": level, "gain_se_psnr_db": 0.2}
        by_field = [c | {"iso": None} for c in cells(level + gain)[:3]]
        by_iso = [{"iso": i, "captures": 9, "psnr_db": level + gain} for i in (100.0, 1600.0)]
        split = {"by_iso": by_iso, "by_field": by_field, "by_iso_and_field": cells(level + gain)}
        rows.append(row | psnr | split)
    return rows


@pytest.fixture
def report() -> dict[str, Any]:
    facts = {"width": 4000, "height": 3000, "accuracy": "3 pictures"}
    return {
        "cameras": {camera: dict(facts) for camera in CAMERAS},
        "rows": [row for n, camera in enumerate(CAMERAS) for row in make_rows(camera, 20.0 + n)],
    }


def _html(section: Section | None) -> str:
    assert section is not None
    return to_html(Page(title="", sections=[section]))


def test_cameras_share_axes_and_each_has_its_colour_and_input(report: dict[str, Any]) -> None:
    rows = report["rows"]
    looks = looks_of(CAMERAS, rows)
    assert [looks.color(rows[0]), looks.color(rows[-1])] == list(CAMERA_COLORS[:2])
    panel = Figure(dpi=100).add_subplot()
    draw_front_panel(panel, report, rows, looks)
    low, high = panel.get_xlim()
    assert all(low < seconds_per_mp(row) < high for row in rows)
    assert seconds_per_mp(rows[0]) == pytest.approx(2.0 / 12)
    assert (panel.get_ylabel(), panel.get_xscale()) == ("PSNR, dB", "log")
    assert panel.get_xlabel().startswith("seconds per megapixel")


def test_a_method_has_one_marker_whatever_the_camera(report: dict[str, Any]) -> None:
    looks = looks_of(CAMERAS, report["rows"])
    assert len(set(looks.markers.values())) == len(looks.markers) == 5
    markers = {(method_name(row), looks.marker(row)) for row in report["rows"]}
    assert len(markers) == 5
    rival = report["rows"][0] | {"bundle": "rival"}
    assert method_name(rival) == "rival S"
    others = looks_of(CAMERAS, [*report["rows"], rival]).markers
    assert len(set(others.values())) == 6


def test_one_picture_holds_all_cameras_their_legend_and_the_field(
    report: dict[str, Any],
) -> None:
    figure = draw_chart(report)
    assert figure is not None
    width, height = figure.get_size_inches()
    assert height > 0.8 * width  # with lower panels
    texts = "\n".join(ET.fromstring(to_svg(figure)).itertext())
    wanted = ("duet", "trio", "network S", "rl (Richardson-Lucy)", "trio input 21.00 dB")
    for word in (*wanted, "ISO 100", "ISO 1600", "distance from the axis, mm", "lower panels"):
        assert word in texts
    assert texts.count("PSNR, dB") == 2


def test_several_cameras_show_their_best_two_methods_over_the_field(
    report: dict[str, Any],
) -> None:
    rows = report["rows"]
    shown = shown_rows(rows)
    assert [(r["camera"], r["label"]) for r in shown] == [
        *(("duet", "M"), ("duet", "rl")),
        *(("trio", "M"), ("trio", "rl")),
    ]
    assert [r["label"] for r in shown_rows(make_rows("duet", 20.0))] == ["S", "M", "wiener", "rl"]
    assert field_isos(shown) == (100.0, 1600.0)
    panel = Figure().add_subplot()
    draw_field_panel(panel, shown, 1600.0, looks_of(CAMERAS, rows))
    assert len(panel.lines) == 4 + 2  # an input for every camera
    assert list(panel.lines[1].get_xdata()) == [0, 10, 20]
    assert list(panel.lines[1].get_ydata()) == [25, 24, 23]


def test_captures_that_were_not_swept_over_the_field_have_no_panel(report: dict[str, Any]) -> None:
    golden = report["rows"][0] | {"by_iso_and_field": cells(20.0)[:4]}
    assert field_isos([golden]) == ()
    assert field_isos([golden | {"by_iso_and_field": []}]) == ()


def test_a_title_says_once_what_all_cameras_share(report: dict[str, Any]) -> None:
    assert title(report, report["rows"]).startswith("3 pictures; ")
    assert NOT_COMPARABLE not in title(report, report["rows"])
    report["cameras"]["trio"]["accuracy"] = "8 scenes"
    lines = title(report, report["rows"])
    assert "duet: 3 pictures; " in lines
    assert "trio: 8 scenes; " in lines
    assert lines.endswith(NOT_COMPARABLE)


def test_a_table_shows_every_plain_method_by_iso_and_place(report: dict[str, Any]) -> None:
    page = _html(split_section(report, "trio"))
    for head in ("ISO 100, n = 9", "ISO 1600, n = 9", "0.5 (10.0 mm), n = 3"):
        assert f"<th>{head}</th>" in page
    assert page.count("<tr>") == 1 + 5  # the variant is left out
    assert "26.00 / 0.500" in page  # M at half the way
    assert "compare methods within one" not in page
    for row in report["rows"]:
        del row["by_iso_and_field"][4:]
    assert "compare methods within one" in _html(split_section(report, "trio"))
    assert split_section({"rows": make_old_rows()}, "duet") is None


def make_old_rows() -> list[Row]:
    """Give rows as they were written before they were split."""
    names = {"by_iso", "by_field", "by_iso_and_field"}
    return [{k: v for k, v in row.items() if k not in names} for row in make_rows("duet", 20.0)]


def test_old_reports_without_a_split_are_still_drawn(
    report: dict[str, Any],
) -> None:
    old = report | {"cameras": {"duet": report["cameras"]["duet"]}, "rows": make_old_rows()}
    assert draw_chart(old) is not None
    assert tuning_section(()) is None


def test_the_tuning_of_every_method_stands_in_a_table() -> None:
    row = {
        "bundle": "duet",
        "method": "rl",
        "size": None,
        "values": {"rounds": 0.7, "most": 80},
        "source": "camkit <code>",
        "captures": "not recorded",
        "follows": "",
    }
    page = _html(tuning_section([row]))
    for text in ("rounds 0.7, most 80", "camkit &lt;code&gt;", "not recorded", ">rl</td>"):
        assert text in page


def test_labels_say_whose_input_a_line_is(report: dict[str, Any]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = Figure(dpi=100)
    FigureCanvasAgg(figure)
    panel = figure.add_subplot()
    looks = looks_of(CAMERAS, report["rows"])
    draw_front_panel(panel, report, report["rows"], looks)
    figure.canvas.draw()
    label_front_panel(panel, report["rows"], looks)
    texts = [text.get_text() for text in panel.texts]
    assert texts[:2] == ["duet input 20.00 dB", "trio input 21.00 dB"]
    assert texts.count("M") == 2


def test_a_row_without_psnr_stands_at_its_time_and_widens_the_axis(report: dict[str, Any]) -> None:
    rows = list(report["rows"])
    slow = dict(rows[0], label="G64", psnr_db=None, seconds_median=3000.0)
    report["rows"] = [*rows, slow, dict(slow, seconds_median=None)]
    panel = Figure(dpi=100).add_subplot()
    draw_front_panel(panel, report, rows, looks_of(CAMERAS, rows))
    assert [t.get_text() for t in panel.texts] == ["G64: not judged"]
    assert panel.get_xlim()[1] > seconds_per_mp(slow)
