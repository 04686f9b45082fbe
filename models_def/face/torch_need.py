"""The check that torch is there, and the way to install it."""

from importlib import util
from typing import Final

from camkit.errors import UnsupportedError

INSTALLED_BY: Final = "pip install 'camkit[train]'"
"""What the design side needs."""


def require_torch(command: str) -> None:
    """Raise an error that says how to install torch, if it is not there.

    Raises:
        UnsupportedError: If torch cannot be imported.
    """
    if util.find_spec("torch") is None:
        raise UnsupportedError(f"{command} needs torch; install with: {INSTALLED_BY}")
