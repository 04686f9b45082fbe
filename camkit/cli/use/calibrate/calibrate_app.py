"""The commands of `camkit calibrate` joined."""

from typing import Final

import typer

from camkit.cli.groups import MEASURE, add_command
from camkit.cli.use.calibrate.blur import blur
from camkit.cli.use.calibrate.bundle import bundle
from camkit.cli.use.calibrate.distance import distance
from camkit.cli.use.calibrate.flat import flat
from camkit.cli.use.calibrate.geometry import geometry
from camkit.cli.use.calibrate.lensfun_in import lensfun_in
from camkit.cli.use.calibrate.lensfun_out import lensfun_out
from camkit.cli.use.calibrate.noise import noise
from camkit.cli.use.calibrate.pairs import pairs
from camkit.cli.use.calibrate.psf import psf
from camkit.cli.use.calibrate.targets import targets
from camkit.cli.use.calibrate.tone import tone

DISPLAY: Final = "Measure with a display"
BUNDLE: Final = "Use the measurements"

calibrate_app = typer.Typer(name="calibrate", no_args_is_help=True)
add_command(calibrate_app, psf, MEASURE, "Measure the point spread function.")
add_command(calibrate_app, blur, MEASURE, "Measure a lens on ordinary photographs.")
add_command(calibrate_app, noise, MEASURE, "Measure gain and read noise.")
add_command(calibrate_app, flat, MEASURE, "Measure the vignetting.")
add_command(calibrate_app, geometry, MEASURE, "Measure focal length and distortion.")
add_command(calibrate_app, distance, MEASURE, "Find a lens's distance origin.")
add_command(calibrate_app, targets, DISPLAY, "Write pictures for a display.")
add_command(calibrate_app, tone, DISPLAY, "Measure a display's tone curve.")
add_command(calibrate_app, pairs, DISPLAY, "Align captures as training pairs.")
add_command(calibrate_app, bundle, BUNDLE, "Store measurements in a bundle.")
add_command(calibrate_app, lensfun_in, BUNDLE, "Make a bundle from lensfun.", name="lensfun-in")
add_command(calibrate_app, lensfun_out, BUNDLE, "Write a lensfun entry.", name="lensfun-out")


@calibrate_app.callback()
def calibrate() -> None:
    """Measure a camera from photographs."""
