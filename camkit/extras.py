"""The packages of extras, which a command needs before it computes anything."""

from collections.abc import Iterable
from importlib import util
from typing import Final

from camkit.errors import UnsupportedError

JUDGE: Final = ("matplotlib", "skimage")
"""Modules of charts, pages and scores of pictures."""
_NAMES: Final = {"skimage": "scikit-image"}
"""Import name -> name to install, where it is another one."""


def install_text(extra: str) -> str:
    """Return the command that installs an extra."""
    return f"pip install 'camkit[{extra}]'"


def missing_packages(modules: Iterable[str]) -> list[str]:
    """Return the names of the packages that are not installed, of modules by their import name."""
    return [_NAMES.get(name, name) for name in modules if util.find_spec(name) is None]


def require_packages(need: str, extra: str, modules: Iterable[str]) -> None:
    """Raise an error that says how to install what is missing.

    Args:
        need: What needs them, with its verb: "camkit export needs".
        extra: Which brings them.
        modules: Their import names.

    Raises:
        UnsupportedError: If one cannot be imported.
    """
    if missing := missing_packages(modules):
        raise UnsupportedError(
            f"{need} {' and '.join(missing)}; install with: {install_text(extra)}"
        )
