"""The writer of every page: a title, what is said first, sections; one file, no other needed.

    Words, Table, Details, Picture, Widget -> Section -> Page -> to_html

A text among the parts of a section is a paragraph, None is nothing. Every table with a header is
sorted by a click on a head.
"""

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from camkit.errors import ContractError
from camkit.report.judge_need import require_judge
from camkit.runtime.output.part_file import write_together

if TYPE_CHECKING:
    from camkit.report.figure import Figure

PNG_START: Final = b"\x89PNG\r\n\x1a\n"
STYLE: Final = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 70em; padding: 0 1em;
  color: #222; background: #fff }
section { border-top: 1px solid #ddd; margin-top: 2em }
table { border-collapse: collapse; margin: .6em 0; font-size: 13px }
td, th { padding: .2em .6em; text-align: right; border-bottom: 1px solid #ddd; white-space: nowrap }
th { background: #f4f4f4; cursor: pointer; user-select: none }
th[aria-sort=ascending]::after { content: " \\25B2" }
th[aria-sort=descending]::after { content: " \\25BC" }
td:first-child, th:first-child, td.words { text-align: left }
td.words { white-space: normal; vertical-align: top; min-width: 12em }
.scroll { overflow-x: auto } .small, figcaption { color: #555; font-size: 13px }
.note { color: #8a4b00 } .bad { color: #b3421a } .best { font-weight: bold }
figure { margin: .6em 0 } img { max-width: 100%; height: auto }
figure.patch { display: inline-block; width: 192px; margin-right: .8em; vertical-align: top }
figure.patch img { width: 192px; image-rendering: pixelated }
"""

SCRIPT: Final = """
for (const head of document.querySelectorAll("th")) {
  head.onclick = () => {
    const table = head.closest("table"), body = table.tBodies[0];
    const up = head.getAttribute("aria-sort") !== "ascending";
    for (const other of table.querySelectorAll("th")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    const value = row => row.cells[head.cellIndex].dataset.value
      ?? row.cells[head.cellIndex].textContent.replace(/^-$/, "");
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


@dataclass(frozen=True, slots=True)
class Words:
    """A paragraph that is not a plain one.

    Attributes:
        text: What is said.
        look: Small print, a note, a fault, or a heading within a section.
    """

    text: str
    look: Literal["small", "note", "bad", "head"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A cell that is more than its text.

    Attributes:
        text: What is shown.
        value: What its column is sorted by; None for the text.
        look: A fault, the best, or words that may be broken.
        anchor: Of the section that a click leads to; empty for none.
    """

    text: str
    value: object = None
    look: Literal["", "bad", "best", "words"] = ""
    anchor: str = ""


Row = Sequence[str | Cell]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table; the first column is aligned left.

    Attributes:
        header: Of the columns; empty for none.
        rows: Of as many cells each.
        meanings: What the columns mean, shown at their heads; empty where they need no word.
    """

    header: Sequence[str] = ()
    rows: Sequence[Row]
    meanings: Sequence[str] = ()

    def __post_init__(self) -> None:
        widths = {len(row) for row in self.rows} | ({len(self.header)} if self.header else set())
        if len(widths) > 1:
            raise ContractError(f"rows of a table must be of one width; got {sorted(widths)} cells")


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture with the words below it.

    Attributes:
        caption: What it shows.
        data: PNG, or the text of an SVG.
        is_patch: Whether it is small and stands beside others.
    """

    caption: str
    data: bytes | str
    is_patch: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.data, bytes) and not self.data.startswith(PNG_START):
            raise ContractError(f"the picture {self.caption!r} of a page must be a PNG or an SVG")


@dataclass(frozen=True, slots=True)
class Widget:
    """A part that a page brings with it, beside the style and the script that it needs.

    Attributes:
        html: Markup, whose texts are escaped already.
    """

    html: str


@dataclass(frozen=True, slots=True)
class Details:
    """A table behind a line that opens it.

    Attributes:
        title: The line.
        table: What it opens.
    """

    title: str
    table: Table


Part = str | Words | Table | Picture | Widget | Details | None


@dataclass(frozen=True, slots=True)
class Section:
    """A part of the page.

    Attributes:
        title: Heading.
        parts: In their order.
        anchor: By which cells lead to it; empty for none.
    """

    title: str
    parts: Sequence[Part]
    anchor: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A page.

    Attributes:
        title: Heading.
        lead: What stands before the sections.
        sections: In their order.
        style: Of its widgets, after that of all pages.
        script: Likewise.
    """

    title: str
    lead: Sequence[Part] = ()
    sections: Sequence[Section]
    style: str = ""
    script: str = ""


def sentences(*notes: str) -> str | None:
    """Return notes as one paragraph of sentences, names of files as they are; None without any."""
    ended = (note if note.endswith((".", ":")) else f"{note}." for note in notes if note)
    return " ".join(map(_begun, ended)) or None


def _begun(note: str) -> str:
    return note if "." in note.split(maxsplit=1)[0].rstrip(".") else note[0].upper() + note[1:]


def escaped(text: str) -> str:
    """Return a text of any origin as markup; what UTF-8 cannot write is a visible escape."""
    return escape(text.encode("utf-8", "backslashreplace").decode())


def to_html(page: Page) -> str:
    """Return the text of a page."""
    parts = [f"<h1>{escaped(page.title)}</h1>", *map(_part, page.lead)]
    for section in page.sections:
        place = f' id="{escaped(section.anchor)}"' if section.anchor else ""
        parts.append(f"<section{place}><h2>{escaped(section.title)}</h2>")
        parts += [*map(_part, section.parts), "</section>"]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{escaped(page.title)}</title><style>{STYLE}{page.style}</style></head>\n<body>"
        + "\n".join(part for part in parts if part)
        + f"\n<script>{SCRIPT}{page.script}</script></body></html>\n"
    )


def _part(part: Part) -> str:
    if part is None:
        return ""
    if isinstance(part, str):
        return f"<p>{escaped(part)}</p>"
    if isinstance(part, Words):
        text = escaped(part.text)
        return f"<h3>{text}</h3>" if part.look == "head" else f'<p class="{part.look}">{text}</p>'
    if isinstance(part, Widget):
        return part.html
    if isinstance(part, Details):
        title = escaped(part.title)
        return f"<details><summary>{title}</summary>{_table(part.table)}</details>"
    return _table(part) if isinstance(part, Table) else _picture(part)


def _picture(picture: Picture) -> str:
    is_png, caption = isinstance(picture.data, bytes), escaped(picture.caption)
    data = picture.data if isinstance(picture.data, bytes) else picture.data.encode()
    source = f"data:image/{'png' if is_png else 'svg+xml'};base64,{base64.b64encode(data).decode()}"
    return (
        f'<figure{" class=patch" * picture.is_patch}><img alt="{caption}" src="{source}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _table(table: Table) -> str:
    titles = [f' title="{escaped(text)}"' for text in table.meanings] or [""] * len(table.header)
    heads = "".join(
        f"<th{title}>{escaped(text)}</th>" for text, title in zip(table.header, titles, strict=True)
    )
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in table.rows)
    head = f"<thead><tr>{heads}</tr></thead>" if heads else ""
    return f"<div class=scroll><table>{head}<tbody>{body}</tbody></table></div>"


def _cell(cell: str | Cell) -> str:
    if isinstance(cell, str):
        return f"<td>{escaped(cell)}</td>"
    text = escaped(cell.text)
    if cell.anchor:
        text = f'<a href="#{escaped(cell.anchor)}">{text}</a>'
    look = f' class="{cell.look}"' if cell.look else ""
    value = "" if cell.value is None else f' data-value="{escaped(str(cell.value))}"'
    return f"<td{look}{value}>{text}</td>"


def page_path(folder: Path, name: str) -> Path:
    """Return the file of a page that is written with its pictures."""
    return folder / f"{name}.html"


def write_page(
    folder: Path,
    name: str,
    charts: Mapping[str, Callable[[], "Figure"]],
    page: Callable[[Mapping[str, str]], Page],
) -> list[Path]:
    """Write NAME.html, and NAME-CHART.svg and .png beside it; all of them or none.

    Args:
        folder: Made if it is not there.
        name: Of the files.
        charts: Name -> what draws it.
        page: Makes the page of the charts, name -> SVG.

    Returns:
        The files, the page first.

    Raises:
        UnsupportedError: If matplotlib is not installed.
    """
    require_judge()
    from camkit.report.figure import to_png, to_svg

    pictures, files = {}, {}
    for chart, draw in charts.items():
        figure = draw()
        pictures[chart] = to_svg(figure)
        figure.set_layout_engine("none")  # all has its place: finding it again takes as long
        files[folder / f"{name}-{chart}.svg"] = pictures[chart].encode()
        files[folder / f"{name}-{chart}.png"] = to_png(figure)
    whole = {page_path(folder, name): to_html(page(pictures)).encode(), **files}
    write_together(whole)
    return list(whole)
