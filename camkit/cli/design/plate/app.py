"""The commands of `camkit plate` joined."""

import typer

from camkit.cli.design.plate.design import design
from camkit.cli.design.plate.masks import masks
from camkit.cli.design.plate.match import match
from camkit.cli.design.plate.show import show

plate_app = typer.Typer(
    name="plate",
    help="One plate: look at it, design it, match it to a PSF, etch it.",
    no_args_is_help=True,
)
plate_app.command()(show)
plate_app.command()(design)
plate_app.command()(masks)
plate_app.command()(match)


@plate_app.callback()
def plate() -> None:
    """One plate: look at it, design it, match it to a PSF, etch it."""
