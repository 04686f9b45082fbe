"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

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
