"""The page docs/reference/commands.md, from the command line itself.

Purpose, usage and options are the help texts of the commands; to change the page, change those.
`GUIDES` names the page that explains a command, or a group of commands.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

import typer

from camkit.cli.app import app
from camkit.cli.groups import JUDGE, MAKE, MEASURE, USE

GUIDES: Final = {
    "process": "pictures.md",
    "plan": "plan.md",
    "simulate": "twin.md",
    "merge": "merging.md",
    "portable": "portable.md",
    "view": "view.md",
    "check": "laws.md",
    "bench": "bench.md",
    "stress": "stress.md",
    "analyse": "analysis.md",
    "make": "make.md",
    "lens": "lens.md",
    "lens convert": "lens-files.md",
    "lens optimize": "lens.md",
    "lens tolerance": "tolerance.md",
    "lens thin": "thin-plate.md",
    "lens peak": "thin-plate.md",
    "lens sag": "thin-plate.md",
    "plate": "plates.md",
    "plate match": "spad-plate.md",
    "design": "design.md",
    "recipe": "make.md",
    "freeze": "lens.md",
    "prepare": "thin-plate.md",
    "train": "training.md",
    "fit-bank": "training.md",
    "freeze-norms": "losses.md",
    "export": "training.md",
    "network": "own-network.md",
    "calibrate": "calibrating.md",
    "calibrate psf": "calibrate-psf.md",
    "calibrate noise": "calibrate-noise.md",
    "calibrate flat": "calibrate-light.md",
    "calibrate tone": "calibrate-light.md",
    "calibrate distance": "calibrate-display.md",
    "calibrate targets": "calibrate-display.md",
    "calibrate pairs": "calibrate-display.md",
    "calibrate geometry": "calibrate-geometry.md",
    "calibrate bundle": "calibrate-bundle.md",
    "doctor": "install.md",
    "psf": "psf-import.md",
}
"""Pages of docs/guides by command; a group's page is that of its commands too."""
EVERYWHERE: Final = frozenset({"--debug", "--help"})
SAME_OPTIONS: Final = {"plan": "process"}
"""Commands whose options are those of another one, and not listed again."""
FLAG: Final = re.compile(r"(?<![`\w-])--[a-z][a-z-]*")
DEFAULT: Final = "; default: "
VALUES: Final = {"int": "integer", "float": "number", "Path": "path"}
"""Types of parameters, as typer names them; all else is text."""
INTRODUCTION: Final = """\
<!-- Written by `python -m tools.reference` from the help texts of the command line. -->

# Commands

This page lists every command with its options, as `camkit COMMAND --help` prints them.

- `camkit --help` lists the commands, `camkit --version` prints the version.
- Every command takes `--help` and `--debug`, which shows tracebacks and log messages on stderr.
- Results go to stdout; messages and progress go to stderr: see [output](output.md).
- Exit codes, limits and frequent messages: see [errors](errors.md).
"""


def command_page() -> str:
    """Return the page: the commands by group, in the order of `camkit --help`."""
    commands: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    parts = [INTRODUCTION]
    for group in (USE, JUDGE, MAKE, MEASURE):
        parts.append(f"## {group}\n")
        for name, command in commands.items():
            if command.rich_help_panel == group:
                parts += _sections(name, command, level=3)
    return "\n".join(parts)


def _sections(name: str, command: Any, *, level: int) -> Iterator[str]:
    """Yield the section of a command, then those of the commands below it."""
    guide = GUIDES.get(name) or GUIDES.get(name.split(maxsplit=1)[0])
    subcommands: dict[str, Any] = getattr(command, "commands", {})
    text = [f"{'#' * level} camkit {name}", _paragraphs(command.help)]
    if guide:
        text.append(f"Guide: [{guide.removesuffix('.md')}](../guides/{guide}).")
    if subcommands:
        rows = [(f"[`{n}`](#camkit-{name}-{n})", _purpose(c)) for n, c in subcommands.items()]
        text.append(table(("command", "purpose"), rows).rstrip())
    else:
        text += [f"```text\n{_usage(name, command)}\n```", _options(name, command)]
    yield "\n\n".join(text) + "\n"
    for part, inner in subcommands.items():
        yield from _sections(f"{name} {part}", inner, level=level + 1)


def _purpose(command: Any) -> str:
    return str(command.short_help or command.help.partition("\n")[0])


def _paragraphs(text: str) -> str:
    """Return a help text with one line for each paragraph, its escapes of rich undone."""
    paragraphs = [" ".join(p.split()) for p in text.replace("\\[", "[").split("\n\n")]
    return "\n\n".join(paragraphs).replace("<", "&lt;")


def _usage(name: str, command: Any) -> str:
    arguments = [_argument(p) for p in command.params if p.param_type_name == "argument"]
    return " ".join(["camkit", name, *arguments, "[OPTIONS]"])


def _argument(parameter: Any) -> str:
    word = (parameter.metavar or parameter.name.upper()).removesuffix("...").strip("[]{}")
    word += "..." if parameter.nargs == -1 else ""
    return word if parameter.required else f"[{word}]"


def _options(name: str, command: Any) -> str:
    """Return the table of what a command takes, or which command takes the same."""
    other = SAME_OPTIONS.get(name)
    if other:
        return f"Arguments and options: those of [`{other}`](#camkit-{other}) that fit."
    rows = [_row(p) for p in command.params if not EVERYWHERE & set(p.opts) and not p.hidden]
    return table(("option", "value", "default", "meaning"), rows).rstrip()


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown, with the end of its last line."""
    lines = [f"| {' | '.join(map(_cell, row))} |\n" for row in (header, *rows)]
    lines.insert(1, f"|{'---|' * len(header)}\n")
    return "".join(lines)


def _row(parameter: Any) -> tuple[str, ...]:
    text = parameter.help.replace("\\[", "[").removesuffix(".")
    meaning, _, default = text.partition(DEFAULT)
    is_argument = parameter.param_type_name == "argument"
    names = [_argument(parameter)] if is_argument else [*parameter.opts, *parameter.secondary_opts]
    return (
        ", ".join(f"`{name}`" for name in names),
        _value(parameter),
        default or _default(parameter),
        f"{meaning}.",
    )


def _default(parameter: Any) -> str:
    """Return a default that no help text names; empty if a parameter may be left out."""
    value = parameter.default
    if parameter.required:
        return "required"
    if getattr(parameter, "is_flag", False):
        return ("off", "on")[bool(value)]
    if isinstance(value, float):
        return f"{value:g}"
    return "" if value is None or callable(value) else str(value)


def _value(parameter: Any) -> str:
    """Return what a parameter takes: nothing for a flag, else its type and range."""
    if getattr(parameter, "is_flag", False):
        return ""
    kind = VALUES.get(parameter.bare_type().removeprefix("list[").rstrip("]"), "text")
    low, high = parameter.min, parameter.max
    if low is not None and high is not None:
        kind += f", {low} to {high}"
    elif low is not None:
        kind += f", at least {low}"
    return kind + (", repeatable" if parameter.multiple else "")


def _cell(text: str) -> str:
    """Return a text for a table: one line, its pipes escaped, options as code."""
    line = " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")
    return FLAG.sub(r"`\g<0>`", line)
