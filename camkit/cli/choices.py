"""Options that several commands share."""

from pathlib import Path
from typing import Annotated, Final

import typer

from camkit.errors import ContractError

INSTALLED_BY: Final = 'pip install -c constraints.txt -e ".[train]"'
"""What the design side needs."""

Debug = Annotated[
    bool, typer.Option("--debug", help="Show tracebacks and what the modules log on stderr.")
]
"""Read by `camkit.cli.app.run`, which sees all arguments; commands only declare it."""
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what is there already.")]
Quality = Annotated[
    str,
    typer.Option(help="exact (M, skips nothing), best (largest size), adaptive or draft."),
]
MaxSeconds = Annotated[
    float | None, typer.Option(help="The best plan that should take no longer on this machine.")
]
MaxErrorDb = Annotated[
    float | None,
    typer.Option(help="The cheapest plan that should lose no more against exact, in dB."),
]
DepthM = Annotated[
    float | None,
    typer.Option(help="Object distance in m, where the bundle knows several; 'inf' is infinity."),
]
GlassFiles = Annotated[
    list[Path] | None,
    typer.Option("--glass", help="A glass catalogue (.agf) of yours; may be given again."),
]


def whole_pair(text: str, option: str) -> tuple[int, int]:
    """Read two whole numbers A,B.

    Raises:
        ContractError: If the text is anything else.
    """
    parts = text.split(",")
    if len(parts) != 2 or not all(p.strip().lstrip("-").isdigit() for p in parts):
        raise ContractError(f"{option} takes two whole numbers A,B; got {text!r}")
    return int(parts[0]), int(parts[1])
