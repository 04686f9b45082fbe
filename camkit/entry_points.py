"""Installed packages: entry points that camkit imports by name, and the packages of extras.

A name is looked up among those that are installed and is never imported itself, so that no file
can choose a module. What needs an extra says so before it computes anything.
"""

from collections.abc import Iterable
from functools import cache
from importlib import import_module, metadata, util
from types import ModuleType
from typing import Final

from camkit.errors import ContractError, UnsupportedError

JUDGE: Final = ("matplotlib", "skimage")
"""Modules of charts, pages and scores of pictures."""
_NAMES: Final = {"skimage": "scikit-image"}
"""Import name -> name to install, where it is another one."""


@cache
def entry_points(group: str) -> dict[str, metadata.EntryPoint]:
    """Return the entry points of a group by name."""
    return {point.name: point for point in metadata.entry_points(group=group)}


def load_entry_point(point: metadata.EntryPoint, what: str) -> object:
    """Import what an entry point names.

    Args:
        point: One of `entry_points`.
        what: What it brings, for the message.

    Raises:
        ContractError: If that fails.
    """
    try:
        return point.load()
    except (ImportError, AttributeError) as error:
        raise ContractError(
            f"the {what} {point.name!r} cannot be loaded from {point.value!r}: {error}"
        ) from error


def load_part(name: str, what: str) -> ModuleType:
    """Import a module that a package names.

    Args:
        name: Of the module.
        what: What it does, for the message.

    Raises:
        ContractError: If that fails.
    """
    try:
        return import_module(name)
    except (ImportError, AttributeError, NameError, SyntaxError) as error:
        raise ContractError(f"{what} cannot be loaded from {name}: {error}") from error


def has_module(name: str) -> bool:
    """Return whether a module is there; one that fails for another reason still raises."""
    try:
        return util.find_spec(name) is not None
    except ModuleNotFoundError as error:
        if f"{name}.".startswith(f"{error.name}."):
            return False
        raise


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
