"""The page of a calibration; one file, no other needed."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Final

from camkit.errors import ContractError
from camkit.report.style import STYLE

_OWN_STYLE: Final = """figure { margin: .6em 0 } img { max-width: 100%; height: auto }
figcaption { color: #555; font-size: 13px }
"""
_PNG: Final = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of texts; the first column is aligned left.

    Attributes:
        header: Of the columns; empty for none.
        rows: Of as many cells each.
    """

    header: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...]

    def __post_init__(self) -> None:
        widths = {len(row) for row in self.rows} | ({len(self.header)} if self.header else set())
        if len(widths) > 1:
            raise ContractError(f"rows of a table must be of one width; got {sorted(widths)} cells")


def sentences(*notes: str) -> str | None:
    """Return notes as one paragraph of sentences, names of files as they are; None without any."""
    ended = (note if note.endswith((".", ":")) else f"{note}." for note in notes if note)
    return " ".join(map(_begun, ended)) or None


def _begun(note: str) -> str:
    return note if "." in note.split(maxsplit=1)[0].rstrip(".") else note[0].upper() + note[1:]


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of the page, in the order of its attributes.

    Attributes:
        title: Heading.
        paragraph: What is to be said first.
        table: None for none.
        pictures: Name, shown below it, -> PNG.
    """

    title: str
    paragraph: str | None = None
    table: Table | None = None
    pictures: Mapping[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, png in self.pictures.items():
            if not png.startswith(_PNG):
                raise ContractError(f"the picture {name!r} of a page must be a PNG")


def to_html(title: str, sections: Sequence[Section]) -> str:
    """Return the page.

    Args:
        title: Heading.
        sections: In their order.
    """
    parts = [f"<h1>{escape(title)}</h1>"]
    for section in sections:
        parts.append(f"<h2>{escape(section.title)}</h2>")
        if section.paragraph is not None:
            parts.append(f"<p>{escape(section.paragraph)}</p>")
        if section.table is not None:
            parts.append(_table(section.table))
        parts += [_picture(name, png) for name, png in section.pictures.items()]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{escape(title)}</title><style>{STYLE}{_OWN_STYLE}</style></head>\n<body>"
        + "\n".join(parts)
        + "</body></html>\n"
    )


def _picture(name: str, png: bytes) -> str:
    data = base64.b64encode(png).decode()
    return (
        f'<figure><img alt="{escape(name)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(name)}</figcaption></figure>"
    )


def _table(table: Table) -> str:
    cells = [_row("th", table.header)] if table.header else []
    cells += [_row("td", row) for row in table.rows]
    return f"<div class=scroll><table>{''.join(cells)}</table></div>"


def _row(tag: str, cells: Sequence[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"
