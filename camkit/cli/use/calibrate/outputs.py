"""The outputs of a command of `camkit calibrate`: a TOML, a page if asked for, the printed text."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

import typer

from camkit.cli.say import say
from camkit.errors import ContractError

Out = Annotated[Path, typer.Option("-o", "--out", help="Result to write (.toml).")]
Page = Annotated[Path | None, typer.Option(help="Also write a self-contained page (.html).")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """The files of the results; made by `checked`, before any work.

    Attributes:
        out: The TOML.
        page: The page; None for none.
        as_json: Print one object instead of lines.
    """

    out: Path
    page: Path | None
    as_json: bool

    @classmethod
    def checked(cls, out: Path, page: Path | None, *, overwrite: bool, as_json: bool) -> Self:
        """Check the outputs that a caller asks for.

        Raises:
            ContractError: If a name is of another kind, or a file is there and may not be replaced.
        """
        if out.suffix.lower() != ".toml":
            raise ContractError(f"a calibration is TOML; expected a name in .toml, got {out}")
        check_page(page, overwrite=overwrite)
        _check_free(out, overwrite=overwrite)
        return cls(out=out, page=page, as_json=as_json)

    def write(
        self, record: Mapping[str, Any], lines: Sequence[str], page: Callable[[], str]
    ) -> None:
        """Write the files, all or none, and print the results.

        Args:
            record: What goes into the TOML and, with the names of the files, into the JSON; its
                `notes`, if any, are said on stderr before the lines.
            lines: What is said without --json, after the name of the TOML.
            page: Gives the page's HTML; called only where one is asked for.

        Raises:
            ContractError: If the record holds what TOML cannot.
        """
        from camkit.calibration.record import to_toml
        from camkit.runtime.output.part_file import atomic_outputs

        texts = {self.out: to_toml(record)}
        if self.page is not None:
            texts[self.page] = page()
        for path in texts:
            path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_outputs(*texts) as parts:
            for part, text in zip(parts, texts.values(), strict=True):
                part.write_text(text, encoding="utf-8")
        both = {"out": self.out, "page": self.page}
        files = {name: str(path) for name, path in both.items() if path is not None}
        if self.as_json:
            say(json.dumps({**record, **files}, allow_nan=False))
            return
        for note in record.get("notes", ()):
            say(f"note: {note}", err=True)
        for line in (f"{file_names(self.out, self.page)}:", *lines):
            say(line)


def check_page(page: Path | None, *, overwrite: bool) -> None:
    """Refuse a page that is no HTML, or is there and may not be replaced.

    Raises:
        ContractError: If so.
    """
    if page is None:
        return
    if page.suffix.lower() != ".html":
        raise ContractError(f"a page is HTML; expected a name in .html, got {page}")
    _check_free(page, overwrite=overwrite)


def check_out(path: Path, suffix: str, what: str, *, overwrite: bool) -> None:
    """Refuse a file of another kind, or one that is there and may not be replaced.

    Args:
        path: Where the result goes.
        suffix: Of its kind, with the dot.
        what: What it is, for the message.
        overwrite: Whether it may be replaced.

    Raises:
        ContractError: If so.
    """
    if path.suffix.lower() != suffix:
        raise ContractError(f"{what} is a file in {suffix}; got {path}")
    _check_free(path, overwrite=overwrite)


def tell(record: Mapping[str, Any], lines: Sequence[str], *, as_json: bool) -> None:
    """Print the results: one object, or notes on stderr and lines."""
    if as_json:
        say(json.dumps(record, allow_nan=False))
        return
    for note in record.get("notes", ()):
        say(f"note: {note}", err=True)
    for line in (f"{file_names(record['out'], record.get('page'))}:", *lines):
        say(line)


def file_names(out: Path | str, page: Path | str | None) -> str:
    """Return the names of the written files."""
    return ", ".join(str(path) for path in (out, page) if path is not None)


def _check_free(path: Path, *, overwrite: bool) -> None:
    if path.exists() and not overwrite:
        raise ContractError(f"{path} exists; add --overwrite or choose another name")
