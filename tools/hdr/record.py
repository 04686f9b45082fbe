"""What tools of snapshot HDR say beside their numbers: which bundle, which methods; and tables."""

import argparse
import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

from camkit.bundle.optics import STREAKS
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.errors import CamkitError, ContractError


def new_parser(description: str) -> argparse.ArgumentParser:
    """Return a parser that asks for a bundle, its sizes and where the numbers go."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", required=True, help="NAME or PATH of a camera with streaks")
    parser.add_argument(
        "--sizes", nargs="*", default=[], help="networks that run too; without, physics alone"
    )
    parser.add_argument("-o", "--output", type=Path, help="the numbers as JSON")
    return parser


def in_one_line(main: Callable[[], None]) -> Callable[[], None]:
    """Let a command end with the line of an error of camkit's own."""

    @wraps(main)
    def told() -> None:
        try:
            main()
        except CamkitError as error:
            raise SystemExit(f"{error}") from error

    return told


def open_camera(name: str, sizes: Sequence[str]) -> Bundle:
    """Open a bundle whose optics write streaks.

    Raises:
        BundleError: If it is refused.
        ContractError: If its optics write none, or it lacks a size.
    """
    bundle = open_bundle(find_bundle(name))
    if STREAKS not in bundle.names:
        raise ContractError(f"{name} holds no {STREAKS}; name a camera that writes streaks")
    lacking = [size for size in sizes if size not in bundle.manifest.sizes]
    if lacking:
        held = ", ".join(bundle.manifest.sizes) or "none"
        raise ContractError(f"{name} holds size(s) {held}; asked for {', '.join(lacking)}")
    return bundle


def origin_of(bundle: Bundle, sizes: Sequence[str]) -> dict[str, Any]:
    """Return what numbers were measured with; those of physics follow from the optics alone."""
    return {
        "bundle": bundle.manifest.name,
        "bundle_sha256": bundle.sha256,
        "optics_sha256": hashlib.sha256(bundle.member(STREAKS)).hexdigest(),
        "methods": ["physics", *sizes],
    }


def write_record(path: Path | None, record: dict[str, Any]) -> None:
    """Write a record as JSON, if there is where to."""
    if path is not None:
        path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown; numbers get one digit behind the point."""
    lines = [_line(head), _line(["---"] * len(head))]
    return "\n".join([*lines, *(_line([_cell(value) for value in row]) for row in rows)])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(value: object) -> str:
    return f"{value:.1f}" if isinstance(value, float) else str(value)
