"""The page of a calibration: complete in itself, and no text of a file becomes markup."""

import base64
import subprocess
import sys
from html.parser import HTMLParser

import pytest

from camkit.errors import ContractError
from camkit.report.calibration.page import Section, Table, sentences, to_html

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


def test_words_tables_and_pictures_come_in_their_order() -> None:
    table = Table(header=("picture", "rms, px"), rows=(("a.png", "0.2"),))
    first = Section(title="Pictures", paragraph="All seen.", table=table, pictures={"Residuals": PNG})  # noqa: E501 # fmt: skip
    seen = _Seen(to_html("Geometry", [first, Section(title="End")]))
    words = [text for text in seen.text if text.strip()]
    assert words[0] == "Geometry"
    assert words[2:] == ["Geometry", "Pictures", "All seen.", "picture", "rms, px", "a.png", "0.2",
                         "Residuals", "End"]  # fmt: skip
    assert seen.tags.count("th") == seen.tags.count("td") == 2


def test_pictures_are_within_the_page() -> None:
    seen = _Seen(to_html("x", [Section(title="y", pictures={"one": PNG})]))
    (source,) = seen.values["src"]
    assert source is not None
    assert base64.b64decode(source.removeprefix("data:image/png;base64,")) == PNG
    assert "href" not in seen.values


def test_texts_never_become_markup() -> None:
    table = Table(header=(HOSTILE,), rows=((HOSTILE,),))
    section = Section(title=HOSTILE, paragraph=HOSTILE, table=table, pictures={HOSTILE: PNG})
    page = to_html(HOSTILE, [section])
    seen = _Seen(page)
    assert "script" not in seen.tags
    assert "".join(seen.text).count(HOSTILE) == 7
    assert seen.values["alt"] == [HOSTILE]


def test_a_row_of_another_width_is_refused() -> None:
    with pytest.raises(ContractError, match="of one width"):
        Table(header=("a", "b"), rows=(("1",),))


def test_what_is_no_png_is_refused() -> None:
    with pytest.raises(ContractError, match="must be a PNG"):
        Section(title="x", pictures={"one": b"GIF89a"})


def test_the_page_needs_no_torch() -> None:
    code = (
        "import sys; sys.modules['torch'] = None; "
        "import camkit.report.calibration.page, camkit.cli.use.calibrate.app"
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
