"""The commands of `camkit analyse` joined."""

import typer

from camkit.cli.judge.analyse.field import field
from camkit.cli.judge.analyse.hallucination import hallucination

analyse_app = typer.Typer(
    name="analyse",
    help="What a camera can tell of a scene, and what it invents.",
    no_args_is_help=True,
)
analyse_app.command()(field)
analyse_app.command()(hallucination)


@analyse_app.callback()
def analyse() -> None:
    """What a camera can tell of a scene, and what it invents."""
