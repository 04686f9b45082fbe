"""Options that the commands of `camkit network` share."""

from pathlib import Path
from typing import Annotated

import typer

Network = Annotated[
    Path, typer.Argument(metavar="NET", help="Network: .onnx, or a state dict of torch (.pth).")
]
Module = Annotated[
    str | None,
    typer.Option(help="Class of a state dict's network, package:Class (needs torch)."),
]
Config = Annotated[
    list[str] | None,
    typer.Option(metavar="KEY=VALUE", help="Argument of that class; may be repeated."),
]
