"""Count what one camera's facts cost the house: modules that name them outside their own rooms.

    python -m tools.rooms                 this tree
    python -m tools.rooms --root OTHER    another checkout, for before and after

A module counts when its code (names and strings, not comments or docstrings) speaks of a fact and
it does not lie in a room of that fact. Production lines are those that are neither blank, comment
nor docstring.
"""

import argparse
import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
HOMES: Final = ("camkit", "runtime", "models_def", "export")
FACTS: Final = {
    "RGB or Bayer": re.compile(r"\b(RGB|rgb|[Bb]ayer\w*|cfa\w*|CFA\w*|mosaic\w*)\b"),
    "S, M, L": re.compile(r"""(?<![\w.])["'][SML]["']"""),
    "Wiener": re.compile(r"\w*[Ww]iener\w*"),
}
ROOMS: Final = {
    "RGB or Bayer": re.compile(
        r"kinds/bayer/|/(sensor|colorimetry|contracts|color|icc|picture|raw\w*|dng\w*|\w*_dng|"
        r"\w*_tags|exr|png|tiff|mosaic|demosaic|directional|white_balance|raise_clipped|upgrade|"
        r"capture|array_capture|exposure|light|simulate|forward|noise|camera)\.py$|"
        r"^runtime/(files|output)/|^camkit/scenes\.py"
    ),
    "S, M, L": re.compile(r"kinds/bayer/|^camkit/bundle/upgrade\.py"),
    "Wiener": re.compile(r"kinds/bayer/|^runtime/bank/|/wiener\.py$|^camkit/bundle/upgrade\.py"),
}


def main() -> int:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", type=Path, default=ROOT)
    parser.add_argument("--list", action="store_true", help="name the modules")
    arguments = parser.parse_args()
    found = {path: code_of(path) for path in modules(arguments.root)}
    for fact in FACTS:
        named = outside(fact, found, arguments.root)
        print(f"{fact:14} {len(named):4} modules outside their rooms")
        for name in named if arguments.list else ():
            print(f"    {name}")
    for home in HOMES:
        own = [code for path, code in found.items() if _name(path, arguments.root).startswith(home)]
        lines = sum(len(code.splitlines()) for code in own)
        print(f"{home:14} {lines:6} lines of code in {len(own)} modules")
    total = sum(len(code.splitlines()) for code in found.values())
    print(f"{'all':14} {total:6} lines of code in {len(found)} modules")
    return 0


def modules(root: Path) -> Iterator[Path]:
    """Return the production modules of a checkout, links not followed."""
    for home in HOMES:
        for path in sorted((root / home).rglob("*.py")):
            inside = path.relative_to(root).parents
            if not any((root / folder).is_symlink() for folder in inside):
                yield path


def code_of(path: Path) -> str:
    """Return the code of a module without comments, docstrings and blank lines."""
    text = path.read_text(encoding="utf-8")
    spoken = {line for start, end in _docstrings(text) for line in range(start, end + 1)}
    kept: dict[int, list[str]] = {}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        silent = token.type in (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE)
        if silent or token.start[0] in spoken or not token.string.strip():
            continue
        kept.setdefault(token.start[0], []).append(token.string)
    return "\n".join(" ".join(kept[line]) for line in sorted(kept))


def _docstrings(text: str) -> Iterator[tuple[int, int]]:
    """Return first and last line of every string that stands alone."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield node.lineno, node.end_lineno or node.lineno


def outside(fact: str, found: dict[Path, str], root: Path) -> list[str]:
    """Name the modules that speak of a fact outside its rooms."""
    return [
        name
        for path, code in found.items()
        if FACTS[fact].search(code) and not ROOMS[fact].search(name := _name(path, root))
    ]


def _name(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix()


if __name__ == "__main__":
    sys.exit(main())
