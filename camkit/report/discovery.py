"""Modules that register themselves by lying in a folder."""

import importlib
import pkgutil
from typing import TypeVar

from camkit.errors import UnsupportedError

_T = TypeVar("_T")


def discover(package: str, name: str, expected: type[_T]) -> tuple[_T, ...]:
    """Return one object of every module of a package, by the modules' names.

    Args:
        package: The folder, by its import name: its modules import the type that it is searched
            for, so that a plain import of it would be a cycle.
        name: Global that every module in it defines.
        expected: Type of that global.

    Raises:
        UnsupportedError: If a module defines none of that type.
    """
    entries = []
    places = importlib.import_module(package).__path__
    for module in sorted(pkgutil.iter_modules(places), key=lambda m: m.name):
        full = f"{package}.{module.name}"
        entry = getattr(importlib.import_module(full), name, None)
        if not isinstance(entry, expected):
            raise UnsupportedError(f"{full} must define {name} as a {expected.__name__}")
        entries.append(entry)
    return tuple(entries)
