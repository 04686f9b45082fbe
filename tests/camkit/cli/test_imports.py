"""A command imports what it needs: no library that it does not use, in a fresh process."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from tests.conftest import OF_CHILDREN

DESIGN: Final = {"torch", "onnxscript", "safetensors.torch", "matplotlib"}
COMPUTING: Final = {
    *("numpy", "scipy", "cv2", "onnx", "onnxruntime", "OpenEXR", "PIL", "rawpy", "tifffile"),
    *("openvino", "safetensors", "camkit.report", "asyncio", "multiprocessing", "unittest"),
}
DEVELOPING: Final = {
    *("scipy", "PIL", "rawpy", "numpy.random", "camkit.report", "rich"),
    *("openvino", "asyncio", "multiprocessing", "unittest"),
    "camkit.runtime.raw_worker",
    "camkit.runtime.twin.simulate",
}
"""Modules for which no photograph has a use that its decoding child does not do."""
WORDS: Final = COMPUTING | {"camkit.bundle", "camkit.runtime", "camkit.arrays", "tomllib"}
"""Modules for which words alone have no use."""
ABSENT: Final = {
    "--version": WORDS | {"rich"},
    "--help": WORDS | {"pydantic"},
    "process": WORDS,
    "process a.dng --nonsense": WORDS,
    "info duet": COMPUTING - {"numpy", "safetensors"} | {"rich", "camkit.runtime.pipeline"},
    "info a.dng": COMPUTING - {"numpy", "cv2", "onnxruntime", "safetensors"} | {"rich"},
    "process none.dng --bundle duet": DEVELOPING | {"OpenEXR", "onnx"},
    "process a.dng --bundle none": DEVELOPING | {"onnx"},
    "process a.dng --bundle duet --force-bundle": DEVELOPING | {"onnx"},
    # the graph of a network that did not come with camkit is checked
    "process a.dng --bundle tiny.camkit": DEVELOPING,
}
"""Command line -> what it runs without; the folder holds a.dng and tiny.camkit."""


def _modules_of(code: str) -> set[str]:
    """Return the modules that a fresh process holds once it ran this code."""
    code += "\nprint('LOADED', *sys.modules)"
    # coverage, where it watches children, imports modules of its own
    unwatched = {name: value for name, value in os.environ.items() if name != OF_CHILDREN}
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}"],
        env=unwatched,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.rpartition("LOADED")[2].split())


@pytest.mark.parametrize("line", ABSENT)
def test_a_command_imports_no_library_that_it_does_not_use(line: str, captures: Path) -> None:
    loaded = _modules_of(f"from camkit.cli.app import run\nrun({line.split()!r})")
    assert "camkit.cli.app" in loaded
    assert sorted(loaded & (ABSENT[line] | DESIGN)) == []


def test_the_decoding_child_imports_no_module_that_only_its_parent_uses() -> None:
    loaded = _modules_of("import camkit.runtime.raw_worker, rawpy")
    assert not loaded & (DESIGN | {*COMPUTING} - {"numpy", "rawpy"})
    assert not loaded & {"typer", "pydantic", "rich", "camkit.psf", "camkit.haze", "camkit.bundle"}
