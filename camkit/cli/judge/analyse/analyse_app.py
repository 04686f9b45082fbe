"""The commands of `camkit analyse` joined."""

import typer

from camkit.cli.groups import JUDGE, add_command
from camkit.cli.judge.analyse.field import field
from camkit.cli.judge.analyse.hallucination import hallucination

analyse_app = typer.Typer(name="analyse", no_args_is_help=True)
add_command(analyse_app, field, JUDGE, "Measure resolution over the field.")
add_command(analyse_app, hallucination, JUDGE, "Find detail that networks invent.")


@analyse_app.callback()
def analyse() -> None:
    """Measure what a camera resolves over its field, and which detail it invents."""
