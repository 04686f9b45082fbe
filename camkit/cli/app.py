"""The commands joined, and the one place where errors become exit codes."""

import sys
from typing import Annotated

import typer

from camkit.cli.check import check
from camkit.cli.doctor import doctor
from camkit.cli.exit_code import ExitCode, exit_code_of
from camkit.cli.export import export
from camkit.cli.freeze import freeze
from camkit.cli.info import info
from camkit.cli.process import process
from camkit.cli.simulate import simulate
from camkit.cli.train import train
from camkit.errors import CamkitError

app = typer.Typer(
    name="camkit",
    help="Computational cameras from design to daily use.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (process, info, check, simulate, doctor, freeze, train, export):
    app.command()(command)


@app.callback(invoke_without_command=True)
def options(
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False,
) -> None:
    """Computational cameras from design to daily use."""
    if version:
        from camkit import __version__

        typer.echo(f"camkit {__version__}")
        raise typer.Exit


def main() -> None:
    """Run the command line; every error of camkit becomes one line on stderr."""
    debug = "--debug" in sys.argv
    try:
        app()
    except CamkitError as error:
        if debug:
            raise
        typer.echo(f"camkit: {error}", err=True)
        sys.exit(exit_code_of(error))
    except KeyboardInterrupt:
        typer.echo("camkit: interrupted", err=True)
        sys.exit(ExitCode.INTERRUPTED)
