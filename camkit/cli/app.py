"""The commands joined, and the one place where errors become exit codes."""

import logging
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated

import typer

from camkit.caller import speaking
from camkit.cli.design.design import design
from camkit.cli.design.export import export
from camkit.cli.design.fit_bank import fit_bank
from camkit.cli.design.freeze import freeze
from camkit.cli.design.freeze_norms import freeze_norms
from camkit.cli.design.lens.lens_app import lens_app
from camkit.cli.design.make import make
from camkit.cli.design.network.network_app import network_app
from camkit.cli.design.plate.plate_app import plate_app
from camkit.cli.design.prepare import prepare
from camkit.cli.design.recipe import recipe
from camkit.cli.design.train import train
from camkit.cli.exit_code import ExitCode, exit_code_of
from camkit.cli.groups import JUDGE, MAKE, MEASURE, USE, add_application, add_command
from camkit.cli.interrupts import none_is_lost
from camkit.cli.judge.analyse.analyse_app import analyse_app
from camkit.cli.judge.bench import bench
from camkit.cli.judge.check import check
from camkit.cli.judge.doctor import doctor
from camkit.cli.judge.stress import stress
from camkit.cli.progress import showing_progress
from camkit.cli.say import plain, say
from camkit.cli.use.calibrate.calibrate_app import calibrate_app
from camkit.cli.use.info import info
from camkit.cli.use.merge import merge
from camkit.cli.use.plan import plan
from camkit.cli.use.portable import portable
from camkit.cli.use.process import process
from camkit.cli.use.psf_group.psf_app import psf_app
from camkit.cli.use.simulate import simulate
from camkit.cli.use.view import view
from camkit.errors import CamkitError
from camkit.stopwatch import Stopwatch

DEBUG_FLAG = "--debug"

app = typer.Typer(
    name="camkit",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
GROUPS = (analyse_app, lens_app, plate_app, network_app, calibrate_app, psf_app)
add_command(app, process, USE, "Restore captures to finished pictures.")
add_command(app, view, USE, "Show results on a page.")
add_command(app, plan, USE, "Preview what process would do.")
add_command(app, simulate, USE, "Simulate captures of a scene.")
add_command(app, merge, USE, "Merge exposures into one EXR.")
add_command(app, info, USE, "Describe a bundle or capture.")
add_command(app, portable, USE, "Write graphs for other programs.")
add_command(app, check, JUDGE, "Verify that a bundle works.")
add_command(app, bench, JUDGE, "Compare speed, accuracy and memory.")
add_command(app, stress, JUDGE, "Find where a network fails.")
add_application(app, analyse_app, JUDGE, "Measure resolution and invented detail.")
add_command(app, doctor, JUDGE, "Examine this computer's camkit installation.")
add_command(app, make, MAKE, "Make a camera from a lens.")
add_application(app, lens_app, MAKE, "Draw, improve or convert lenses.")
add_application(app, plate_app, MAKE, "Design diffractive plates and masks.")
add_command(app, design, MAKE, "Design lens and network together.")
add_command(app, recipe, MAKE, "Write the recipe of a camera.")
add_command(app, freeze, MAKE, "Compute the PSF of optics.")
add_command(app, prepare, MAKE, "Prepare training with veiling glare.")
add_command(app, train, MAKE, "Train a camera's restoration network.")
add_command(app, fit_bank, MAKE, "Fit a joint-colour filter bank.")
add_command(app, freeze_norms, MAKE, "Replace instance norms with constants.")
add_command(app, export, MAKE, "Pack results into a bundle.")
add_application(app, network_app, MAKE, "Bring a network of your own.")
add_application(app, calibrate_app, MEASURE, "Measure a camera from photographs.")
add_application(app, psf_app, MEASURE, "Import a measured PSF.")


@app.callback(invoke_without_command=True)
def options(
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False,
) -> None:
    """Run computational cameras, from design to daily use."""
    if version:
        from camkit import __version__

        say(f"camkit {__version__}")
        raise typer.Exit


def main() -> None:
    """Run the command line and end the process with its exit code."""
    sys.exit(run(sys.argv[1:], Stopwatch.of_process()))


def run(arguments: Sequence[str], stopwatch: Stopwatch | None = None) -> int:
    """Run one command line; every expected error becomes one line on stderr.

    Args:
        arguments: Without the name of the program.
        stopwatch: What commands with a budget of time count by; None begins now.

    Returns:
        The exit code. A reader that closes the pipe early ends the run with 1, without a word.
    """
    debug = DEBUG_FLAG in arguments
    try:
        with (
            speaking("command"),
            _messages(is_shown=debug),
            none_is_lost(),
            showing_progress(_command_name(arguments)),
        ):
            app(list(arguments), prog_name="camkit", obj=stopwatch or Stopwatch())
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else ExitCode.INPUT_FAILED
        if code == ExitCode.INTERRUPTED:
            say("camkit: interrupted", err=True)
        return code
    except (CamkitError, OSError) as error:
        if debug:
            say(traceback.format_exc(), err=True)
        say(f"camkit: {_one_line(error)}", err=True)
        return exit_code_of(error)
    return ExitCode.DONE


def _command_name(arguments: Sequence[str]) -> str:
    """Return the command of a command line, with that of its group: camkit lens peak."""
    words = [word for word in arguments if not word.startswith("-")]
    count = 2 if words and words[0] in {group.info.name for group in GROUPS} else 1
    return " ".join(["camkit", *words[:count]])


class _PlainFormatter(logging.Formatter):
    """Messages and tracebacks whose control characters are visible escapes."""

    def format(self, record: logging.LogRecord) -> str:
        return plain(super().format(record))


class _SayHandler(logging.Handler):
    """Says records on stderr, in place of a line of progress."""

    def emit(self, record: logging.LogRecord) -> None:
        say(self.format(record), err=True)


@contextmanager
def _messages(*, is_shown: bool) -> Iterator[None]:
    """Show what camkit's modules log, for `--debug`."""
    if not is_shown:
        yield
        return
    logger, handler = logging.getLogger("camkit"), _SayHandler()
    handler.setFormatter(_PlainFormatter())
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        logger.setLevel(level)
        logger.removeHandler(handler)


def _one_line(error: Exception) -> str:
    text = str(error)
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        text = f"{error.filename}: {error.strerror}"
    return " ".join(text.split()) or type(error).__name__
