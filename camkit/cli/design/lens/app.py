"""The commands of `camkit lens` joined."""

import typer

from camkit.cli.design.lens.convert import convert
from camkit.cli.design.lens.optimize import optimize
from camkit.cli.design.lens.peak import peak
from camkit.cli.design.lens.sag import sag
from camkit.cli.design.lens.show import show
from camkit.cli.design.lens.thin import thin
from camkit.cli.design.lens.tolerance import tolerance

lens_app = typer.Typer(
    name="lens", help="One lens: look at it, improve it, convert it.", no_args_is_help=True
)
lens_app.command()(show)
lens_app.command()(optimize)
lens_app.command()(tolerance)
lens_app.command()(convert)
lens_app.command()(thin)
lens_app.command()(peak)
lens_app.command()(sag)


@lens_app.callback()
def lens() -> None:
    """One lens: look at it, improve it, convert it."""
