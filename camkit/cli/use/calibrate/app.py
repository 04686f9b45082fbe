"""The commands of `camkit calibrate` joined."""

import typer

from camkit.cli.use.calibrate.bundle import bundle
from camkit.cli.use.calibrate.flat import flat
from camkit.cli.use.calibrate.geometry import geometry
from camkit.cli.use.calibrate.lensfun_in import lensfun_in
from camkit.cli.use.calibrate.lensfun_out import lensfun_out
from camkit.cli.use.calibrate.noise import noise
from camkit.cli.use.calibrate.pairs import pairs
from camkit.cli.use.calibrate.psf import psf
from camkit.cli.use.calibrate.targets import targets
from camkit.cli.use.calibrate.tone import tone

calibrate_app = typer.Typer(
    name="calibrate", help="Measure a camera on photographs.", no_args_is_help=True
)
calibrate_app.command()(psf)
calibrate_app.command()(noise)
calibrate_app.command()(flat)
calibrate_app.command()(tone)
calibrate_app.command()(geometry)
calibrate_app.command()(targets)
calibrate_app.command()(pairs)
calibrate_app.command()(bundle)
calibrate_app.command("lensfun-in")(lensfun_in)
calibrate_app.command("lensfun-out")(lensfun_out)


@calibrate_app.callback()
def calibrate() -> None:
    """Measure a camera on photographs."""
