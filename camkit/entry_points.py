"""Entry points of installed packages: all that camkit imports by a name that it did not know.

A name is looked up among those that are installed and is never imported itself, so that no file
can choose a module.
"""

from functools import cache
from importlib import import_module, metadata, util
from types import ModuleType

from camkit.errors import ContractError


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
