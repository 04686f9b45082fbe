"""The commands of `camkit lens` joined."""

from typing import Final

import typer

from camkit.cli.design.lens.convert import convert
from camkit.cli.design.lens.optimize import optimize
from camkit.cli.design.lens.peak import peak
from camkit.cli.design.lens.sag import sag
from camkit.cli.design.lens.show import show
from camkit.cli.design.lens.thin import thin
from camkit.cli.design.lens.tolerance import tolerance
from camkit.cli.groups import add_command

LENS: Final = "Draw and measure a lens"
WORK: Final = "Make a lens"

lens_app = typer.Typer(name="lens", no_args_is_help=True)
add_command(lens_app, show, LENS, "Draw and measure a lens.")
add_command(lens_app, peak, LENS, "Measure peak and veiling glare.")
add_command(lens_app, tolerance, LENS, "Simulate fabrication errors and yield.")
add_command(lens_app, optimize, WORK, "Improve a lens's spots.")
add_command(lens_app, thin, WORK, "Solve a thin grooved plate.")
add_command(lens_app, convert, WORK, "Convert a lens file.")
add_command(lens_app, sag, WORK, "Write a surface's height profile.")


@lens_app.callback()
def lens() -> None:
    """Draw, measure, improve or convert a lens (needs torch)."""
