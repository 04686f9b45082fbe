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
from camkit.cli.design.lens.app import lens_app
from camkit.cli.design.plate.app import plate_app
from camkit.cli.design.prepare import prepare
from camkit.cli.design.train import train
from camkit.cli.exit_code import ExitCode, exit_code_of
from camkit.cli.interrupts import none_is_lost
from camkit.cli.judge.analyse.app import analyse_app
from camkit.cli.judge.bench import bench
from camkit.cli.judge.check import check
from camkit.cli.judge.doctor import doctor
from camkit.cli.judge.stress import stress
from camkit.cli.progress import shown
from camkit.cli.say import plain, say
from camkit.cli.use.calibrate.app import calibrate_app
from camkit.cli.use.info import info
from camkit.cli.use.merge import merge
from camkit.cli.use.plan import plan
from camkit.cli.use.process import process
from camkit.cli.use.simulate import simulate
from camkit.errors import CamkitError
from camkit.stopwatch import Stopwatch

DEBUG_FLAG = "--debug"

app = typer.Typer(
    name="camkit",
    help="Computational cameras from design to daily use.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (
    process,
    plan,
    info,
    check,
    simulate,
    merge,
    stress,
    doctor,
    bench,
    design,
    freeze,
    prepare,
    train,
    fit_bank,
    freeze_norms,
    export,
):
    app.command()(command)
GROUPS = (analyse_app, lens_app, calibrate_app, plate_app)
for group in GROUPS:
    app.add_typer(group)


@app.callback(invoke_without_command=True)
def options(
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False,
) -> None:
    """Computational cameras from design to daily use."""
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
            _messages(shown=debug),
            none_is_lost(),
            shown(_command_name(arguments)),
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


@contextmanager
def _messages(*, shown: bool) -> Iterator[None]:
    """Show what camkit's modules log, for `--debug`."""
    if not shown:
        yield
        return
    logger, handler = logging.getLogger("camkit"), logging.StreamHandler()
    handler.setFormatter(_PlainFormatter())
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        logger.setLevel(before)
        logger.removeHandler(handler)


def _one_line(error: Exception) -> str:
    text = str(error)
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        text = f"{error.filename}: {error.strerror}"
    return " ".join(text.split()) or type(error).__name__
