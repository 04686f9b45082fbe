"""The toy camera as if somebody had installed it: an entry point in a throw-away folder."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from camkit import kinds

ROOT = Path(__file__).resolve().parents[2]


def write_entry_point(folder: Path) -> None:
    """Write what `pip` would write beside a package that names the kind."""
    facts = folder / "toy_camera-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Name: toy-camera\nVersion: 1.0\n", encoding="utf-8")
    text = f"[{kinds.GROUP}]\ntoy = tests.toy_camera:KIND\n"
    (facts / "entry_points.txt").write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def toy_installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Install the toy camera for a module, in this process and those that it starts."""
    folder = tmp_path_factory.mktemp("site")
    write_entry_point(folder)
    known = os.environ.get("PYTHONPATH", "")
    paths = [str(folder), str(ROOT), *([known] if known else [])]
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        patch.setenv("PYTHONPATH", os.pathsep.join(paths))
        kinds._installed.cache_clear()
        yield
    kinds._installed.cache_clear()
