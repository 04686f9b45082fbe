"""Packages as if somebody had installed them: entry points in a throw-away folder."""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

from camkit.entry_points import entry_points
from camkit.runtime.stage_finder import stage_module

ROOT = Path(__file__).resolve().parents[1]
Points = Mapping[str, Mapping[str, str]]
"""Group of entry points -> name -> what it names."""


def write_entry_points(folder: Path, package: str, points: Points) -> None:
    """Write what `pip` would write beside a package."""
    facts = folder / f"{package.replace('-', '_')}-1.0.dist-info"
    facts.mkdir(exist_ok=True)
    (facts / "METADATA").write_text(f"Name: {package}\nVersion: 1.0\n", encoding="utf-8")
    lines = [
        line
        for group, named in points.items()
        for line in (f"[{group}]", *(f"{name} = {value}" for name, value in named.items()))
    ]
    (facts / "entry_points.txt").write_text("\n".join([*lines, ""]), encoding="utf-8")


@contextmanager
def installed(folder: Path, package: str, points: Points) -> Iterator[None]:
    """Install a package that lies in a folder, or in this repository.

    It is installed for this process and those that it starts.
    """
    write_entry_points(folder, package, points)
    paths = [str(folder), str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    before = set(sys.modules)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        patch.setenv("PYTHONPATH", os.pathsep.join(paths))
        _forget()
        yield
    _forget()
    for name in set(sys.modules) - before:
        file = getattr(sys.modules[name], "__file__", None)
        if file is not None and Path(file).is_relative_to(folder):
            del sys.modules[name]


def _forget() -> None:
    """Forget what was installed before."""
    entry_points.cache_clear()
    stage_module.cache_clear()
