"""The commands of `camkit psf` joined."""

import typer

from camkit.cli.groups import MEASURE, add_command
from camkit.cli.use.psf_group.psf_import import psf_import

psf_app = typer.Typer(name="psf", no_args_is_help=True)
add_command(psf_app, psf_import, MEASURE, "Import kernels of other programs.", name="import")


@psf_app.callback()
def psf() -> None:
    """Import a PSF that was measured or computed elsewhere."""
