"""The packages, found on disk: every folder with an `__init__.py` in the homes of pyproject.toml.

All else stands in pyproject.toml. Its `packages.find` would do but for one thing: it names a
package by its path, and so reaches `camkit.runtime` only through the link `camkit/runtime`. An
sdist and a zip of the repository hold no links, and a wheel built there would lack the runtime
without a word.

An editable install puts one folder on the path that holds a link to `camkit` and nothing else. The
import hook that setuptools would write is unseen by type checkers, and the root of the checkout
would make `runtime` and `export` importable.
"""

import sys
import tomllib
from pathlib import Path
from typing import Any

from setuptools import find_packages, setup

ROOT = Path(__file__).resolve().parent


def packages() -> list[str]:
    """Return the import names of all packages, those behind a link once."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    homes: dict[str, str] = settings["tool"]["setuptools"]["package-dir"]
    inner = {f"{name}.{p}" for name, home in homes.items() for p in find_packages(ROOT / home)}
    return sorted(inner.union(homes))


def editable() -> dict[str, Any]:
    """Return what an editable install needs; nothing where links cannot be made or are missing."""
    home, source = ROOT / ".editable", ROOT / "camkit"
    if "editable_wheel" not in sys.argv or not (source / "runtime" / "__init__.py").is_file():
        return {}
    link = home / "camkit"
    try:
        home.mkdir(exist_ok=True)
        link.unlink(missing_ok=True)
        link.symlink_to(Path("..", "camkit"), target_is_directory=True)
    except OSError:
        return {}
    return {"package_dir": {"": home.name}, "options": {"editable_wheel": {"mode": "compat"}}}


setup(packages=packages(), **editable())
