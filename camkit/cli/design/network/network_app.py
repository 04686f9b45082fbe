"""The commands of `camkit network` joined."""

from typing import Final

import typer

from camkit.cli.design.network.network_add import add
from camkit.cli.design.network.network_inspect import inspect
from camkit.cli.groups import add_command

NETWORK: Final = "Bring a network"

network_app = typer.Typer(name="network", no_args_is_help=True)
add_command(network_app, inspect, NETWORK, "Show everything in a network's way.")
add_command(network_app, add, NETWORK, "Add a network to a camera.")


@network_app.callback()
def network() -> None:
    """Check a trained network of your own, or add it to a camera's bundle."""
