"""The commands of `camkit plate` joined."""

from typing import Final

import typer

from camkit.cli.design.plate.masks import masks
from camkit.cli.design.plate.match import match
from camkit.cli.design.plate.plate_design import design
from camkit.cli.design.plate.plate_show import show
from camkit.cli.groups import add_command

PLATE: Final = "Make a plate"

plate_app = typer.Typer(name="plate", no_args_is_help=True)
add_command(plate_app, show, PLATE, "Draw and measure a plate.")
add_command(plate_app, design, PLATE, "Optimize the relief of a plate.")
add_command(plate_app, match, PLATE, "Find a plate for a PSF.")
add_command(plate_app, masks, PLATE, "Write the masks for etching.")


@plate_app.callback()
def plate() -> None:
    """Draw, design or match a diffractive plate, and write its masks (needs torch)."""
