"""The page and the programs of examples/, built where node and npm are at hand."""

import fcntl
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
PAGE = EXAMPLES / "browser" / "dist" / "index.html"
PROGRAMS = EXAMPLES / "node" / "dist"
_PACKAGES = EXAMPLES / "node_modules" / ".package-lock.json"


def build_examples() -> None:
    """Build them anew if a source is newer; skip the test where that cannot be."""
    for program in ("node", "npm"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not there; install it to test the examples in JavaScript")
    # processes of tests beside each other build once
    with (Path(tempfile.gettempdir()) / f"camkit_examples_{os.getuid()}").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not _is_newer(_PACKAGES, [EXAMPLES / "package-lock.json"]):
            made = _run("npm", "ci")
            if made.returncode:
                pytest.skip(f"npm cannot bring the packages of the examples: {made.stderr[-200:]}")
        sources = [path for part in ("core", "node", "browser") for path in _sources(part)]
        if not _is_newer(PAGE, [_PACKAGES, EXAMPLES / "build.mjs", *sources]):
            made = _run("npm", "run", "build")
            assert made.returncode == 0, made.stdout + made.stderr


def _sources(folder: str) -> list[Path]:
    return [path for path in (EXAMPLES / folder).iterdir() if path.is_file()]


def _is_newer(made: Path, sources: list[Path]) -> bool:
    return made.exists() and all(made.stat().st_mtime >= s.stat().st_mtime for s in sources)


def _run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        words, cwd=EXAMPLES, capture_output=True, text=True, timeout=240, check=False
    )
