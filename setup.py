"""The packages, found on disk: every folder with an `__init__.py` in the homes of pyproject.toml.

All else stands in pyproject.toml. Its `packages.find` would do but for one thing: it names a
package by its path, and so reaches `camkit.runtime` only through the link `camkit/runtime`. An
sdist and a zip of the repository hold no links, and a wheel built there would lack the runtime
without a word.
"""

import tomllib
from pathlib import Path

from setuptools import find_packages, setup

ROOT = Path(__file__).resolve().parent


def packages() -> list[str]:
    """Give the import names of all packages, those behind a link once."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    homes: dict[str, str] = settings["tool"]["setuptools"]["package-dir"]
    inner = {f"{name}.{p}" for name, home in homes.items() for p in find_packages(ROOT / home)}
    return sorted(inner.union(homes))


setup(packages=packages())
