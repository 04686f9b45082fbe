"""The writer of pages: complete in itself, and no text of a file becomes markup."""

import base64
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import cv2
import pytest

from camkit import entry_points
from camkit.errors import ContractError, UnsupportedError
from camkit.report.figure import Figure, chart, new_figure
from camkit.report.pages import page as writer
from camkit.report.pages.page import (
    SCRIPT,
    Cell,
    Page,
    Part,
    Picture,
    Section,
    Table,
    Words,
    page_path,
    sentences,
    to_html,
    write_page,
)

PNG = b"\x89PNG\r\n\x1a\nand more"
HOSTILE = "</title><script>alert('&\"')</script>"


class _Seen(HTMLParser):
    """Tags, sources and text of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.values: dict[str, list[str | None]] = {}
        self.text: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            self.values.setdefault(name, []).append(value)

    def handle_data(self, data) -> None:
        self.text.append(data)


def _seen(*parts: Part, title: str = "x", anchor: str = "") -> _Seen:
    return _Seen(to_html(Page(title=title, sections=[Section(title, parts, anchor)])))


def test_words_tables_and_pictures_come_in_their_order() -> None:
    table = Table(header=("picture", "rms, px"), rows=(("a.png", "0.2"),))
    first = Section("Pictures", ("All seen.", None, table, Picture("Residuals", PNG)))
    whole = Page(title="Geometry", lead=("Hear.",), sections=[first, Section("End", ())])
    seen = _Seen(to_html(whole))
    words = [text for text in seen.text if text.strip() and text.strip() != SCRIPT.strip()]
    assert words[0] == "Geometry"
    assert words[2:] == ["Geometry", "Hear.", "Pictures", "All seen.", "picture", "rms, px",
                         "a.png", "0.2", "Residuals", "End"]  # fmt: skip
    assert seen.tags.count("th") == seen.tags.count("td") == 2


def test_pictures_are_within_the_page() -> None:
    seen = _seen(Picture("one", PNG), Picture("two", "<svg/>", is_patch=True))
    png, svg = (str(source) for source in seen.values["src"])
    assert base64.b64decode(png.removeprefix("data:image/png;base64,")) == PNG
    assert base64.b64decode(svg.removeprefix("data:image/svg+xml;base64,")) == b"<svg/>"
    assert "href" not in seen.values


def test_texts_never_become_markup() -> None:
    cell = Cell(text=HOSTILE, value=HOSTILE, anchor=HOSTILE)
    table = Table(header=(HOSTILE,), rows=((HOSTILE,), (cell,)), meanings=(HOSTILE,))
    parts = (HOSTILE, Words(HOSTILE, "bad"), Words(HOSTILE, "head"), table, Picture(HOSTILE, PNG))
    seen = _seen(*parts, title=HOSTILE, anchor=HOSTILE)
    assert seen.tags.count("script") == 1  # the page's own
    assert "".join(seen.text).count(HOSTILE) == 3 + 3 + 3 + 1
    for name in ("alt", "title", "id", "data-value"):
        assert seen.values[name] == [HOSTILE]


def test_a_cell_leads_to_the_section_of_its_anchor() -> None:
    seen = _seen(Table(rows=((Cell(text="Haze", anchor="haze"),),)), anchor="haze")
    assert seen.values["href"] == ["#haze"]
    assert seen.values["id"] == ["haze"]


def test_a_column_is_sorted_by_the_value_of_its_cells() -> None:
    table = Table(header=("s",), rows=((Cell(text="10.50", value=10.5),), ("-",)))
    assert _seen(table).values["data-value"] == ["10.5"]


def test_a_row_of_another_width_is_refused() -> None:
    with pytest.raises(ContractError, match="of one width"):
        Table(header=("a", "b"), rows=(("1",),))


def test_what_is_no_png_is_refused() -> None:
    with pytest.raises(ContractError, match="must be a PNG"):
        Picture("one", b"GIF89a")


def test_the_page_needs_no_torch() -> None:
    code = (
        "import sys; sys.modules['torch'] = None; "
        "import camkit.report.pages.page, camkit.cli.use.calibrate.calibrate_app"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_notes_become_sentences() -> None:
    assert sentences() is None
    assert sentences("one is off", "NOT told apart:", "two.", "") == (
        "One is off. NOT told apart: Two."
    )
    assert sentences("a: do not use it", "the centre lies off") == (
        "A: do not use it. The centre lies off."
    )
    assert sentences("board_03.png: no board found") == "board_03.png: no board found."


@chart
def _drawn() -> Figure:
    figure = new_figure(2, 2)
    line, picture = figure.subplots(1, 2)
    line.plot([0, 1])
    picture.imshow([[0, 1]])
    return figure


def test_charts_share_one_style_and_pictures_in_them_have_no_grid() -> None:
    line, picture = _drawn().axes
    assert line.xaxis.get_tick_params()["gridOn"]
    assert not picture.xaxis.get_tick_params()["gridOn"]


def test_a_page_is_written_with_its_charts(tmp_path: Path) -> None:
    def page(pictures) -> Page:
        return Page(title="One", sections=[Section("A", (Picture("", pictures["a"]),))])

    files = write_page(tmp_path / "new", "one", {"a": _drawn}, page)
    assert files == [page_path(tmp_path / "new", "one"), *files[1:]]
    assert [path.name for path in files] == ["one.html", "one-a.svg", "one-a.png"]
    assert files[2].read_bytes().startswith(writer.PNG_START)
    assert cv2.imread(str(files[2])).shape == (260, 260, 3)  # of 2 inches at 130 dpi
    again = write_page(tmp_path / "again", "one", {"a": _drawn}, page)
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in files]


def test_without_matplotlib_no_page_with_charts_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(entry_points.util, "find_spec", lambda _: None)
    with pytest.raises(UnsupportedError, match=r"pip install 'camkit\[judge\]'"):
        write_page(tmp_path / "new", "one", {}, lambda _: Page(title="", sections=[]))
    assert not (tmp_path / "new").exists()
