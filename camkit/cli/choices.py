"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.errors import ContractError

Debug = Annotated[bool, typer.Option("--debug", help="Show tracebacks and log messages on stderr.")]
"""Read by `camkit.cli.app.run`, which sees all arguments; commands only declare it."""
Json = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing output files.")]
Quality = Annotated[
    str,
    typer.Option(
        help="Quality: exact (size M), best (largest size), adaptive (as needed) or draft "
        "(fastest)."
    ),
]
MaxSeconds = Annotated[
    float | None, typer.Option(help="Time limit in s; the best plan expected to meet it is chosen.")
]
MaxErrorDb = Annotated[
    float | None,
    typer.Option(
        help="Largest loss against exact in dB; the fastest plan expected to meet it is chosen."
    ),
]
DepthM = Annotated[
    float | None,
    typer.Option(
        help="Object distance in m ('inf' for infinity), for bundles with several distances."
    ),
]
FrozenState = Annotated[
    str | None,
    typer.Option(
        "--configuration",
        help="State of a zoom or focusing lens, by name or number; default: the bundle's first.",
    ),
]
GlassFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--glass",
        help="Glass catalogue (.agf), or what decides in a .zmx: names or numbers; repeatable.",
    ),
]
GlassCatalogues = Annotated[
    str | None,
    typer.Option(
        "--catalogue",
        help="Glass catalogues asked first for a name that several have, such as schott,hikari.",
    ),
]
Configuration = Annotated[
    str | None,
    typer.Option(
        "--configuration",
        help="State of a zoom or focusing lens, by name or number; default: the file's.",
    ),
]


def several_states(text: str | None) -> str | tuple[str, ...] | None:
    """Return the names of configurations in a text A,B; one word as it is."""
    names = () if text is None else tuple(name.strip() for name in text.split(","))
    return names if len(names) > 1 else text


def whole_pair(text: str, option: str) -> tuple[int, int]:
    """Read two whole numbers A,B.

    Raises:
        ContractError: If the text is anything else.
    """
    parts = text.split(",")
    if len(parts) != 2 or not all(p.strip().lstrip("-").isdigit() for p in parts):
        raise ContractError(f"{option} takes two whole numbers A,B; got {text!r}")
    return int(parts[0]), int(parts[1])
