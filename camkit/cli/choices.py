"""Options that several commands share."""

from typing import Annotated

import typer

Debug = Annotated[
    bool, typer.Option("--debug", help="Show tracebacks and what the modules log on stderr.")
]
"""Read by `camkit.cli.app.run`, which sees all arguments; commands only declare it."""
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace OUT.")]
