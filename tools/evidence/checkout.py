"""A checkout of camkit, this one or another, run in child processes.

Children import `camkit` from the checkout and `tools.evidence` from here, so that one tool measures
an older and a newer checkout alike.
"""

import json
import os
import subprocess
import sys
import time
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

HERE: Final = Path(__file__).resolve().parents[2]
BOOT: Final = (
    "import sys, runpy, camkit; sys.path.insert(0, sys.argv[1]); "
    "runpy.run_module(sys.argv[2], run_name='__main__')"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkout:
    """A checkout.

    Attributes:
        root: Its folder.
        work: The folder in which its children run.
    """

    root: Path
    work: Path

    @property
    def commit(self) -> str:
        """Return its commit, with a plus where files differ from it; empty outside git."""
        words = ["git", "-C", str(self.root), "describe", "--always", "--abbrev=8", "--dirty=+"]
        process = subprocess.run(words, capture_output=True, text=True, check=False)
        return process.stdout.strip()

    @property
    def bundles(self) -> list[str]:
        """Name its built-in bundles."""
        return sorted(path.stem for path in (self.root / "camkit" / "bundles").glob("*.camkit"))

    @property
    def folders(self) -> tuple[str, ...]:
        """Return the folders whose names say nothing of what was computed."""
        return (f"{self.work}/", f"{self.root}/", f"{HERE}/")

    def bundle_file(self, bundle: str) -> Path:
        """Return the file of a built-in bundle."""
        return self.root / "camkit" / "bundles" / f"{bundle}.camkit"

    def manifest(self, bundle: str) -> dict[str, Any]:
        """Return the manifest of a built-in bundle."""
        with zipfile.ZipFile(self.bundle_file(bundle)) as members:
            return dict(json.loads(members.read("manifest.json")))

    @property
    def environment(self) -> dict[str, str]:
        """Return the variables of its children."""
        # numpy's matrix products differ in their last bits by the number of their threads
        return {**os.environ, "PYTHONPATH": str(self.root), "OMP_NUM_THREADS": "1"}

    def command(self, words: list[str]) -> tuple[subprocess.CompletedProcess[str], float]:
        """Run `camkit` with some words; return what it told, and its seconds."""
        began = time.perf_counter()
        process = subprocess.run(
            [sys.executable, "-P", "-m", "camkit", *words],
            cwd=self.work,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return process, time.perf_counter() - began


class Worker:
    """A child that processes captures with a checkout's camkit; ends with `with`."""

    def __init__(self, checkout: Checkout) -> None:
        self._checkout = checkout
        self._child = self._started()

    def _started(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-P", "-c", BOOT, str(HERE), "tools.evidence.worker"],
            cwd=self._checkout.work,
            env=self._checkout.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, job: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to a job; a child that dies is replaced, and the answer says so."""
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        self._child.stdin.write(json.dumps(job) + "\n")
        self._child.stdin.flush()
        answer = self._child.stdout.readline()
        if answer:
            return dict(json.loads(answer))
        self._child.communicate()
        code = self._child.returncode
        self._child = self._started()
        return {"failed": f"the worker ended with exit code {code}"}

    def __enter__(self) -> Self:
        """Return the worker."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the child."""
        self._child.communicate()
