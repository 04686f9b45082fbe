"""A small batch in a forked process of its own, with one fault planted, under a time limit."""

import json
import os
import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from camkit.errors import CamkitError
from camkit.runtime.batch import process
from camkit.runtime.network import engine, graph  # loaded before anything is counted
from camkit.runtime.output import dng, exr, linear_dng, png, tiff_writer, writer
from tests.faults.injection import Faults

LOADED: Final = (engine, graph, dng, exr, linear_dng, png, tiff_writer, writer)
MOST_S: Final = 120


@dataclass
class End:
    """How a run ended.

    Attributes:
        signal: What killed it; 0 for nothing.
        files: Capture -> [status, error].
        ended: The error that ended the whole run; empty without one.
        seen: What could have failed, in order.
        stderr: What it said on the side.
    """

    signal: int = 0
    files: dict[str, list[Any]] = field(default_factory=dict)
    ended: str = ""
    seen: list[str] = field(default_factory=list)
    stderr: str = ""


def run_small_batch(folder: Path, format_: str, faults: Faults) -> End:
    """Process the captures of a folder into `out`, with what is planted.

    Raises:
        TimeoutError: If it hangs.
    """
    told, aside = folder / "told.json", folder / "stderr.txt"
    told.unlink(missing_ok=True)
    child = os.fork()
    if child == 0:
        _run(folder, format_, faults, told, aside)
    limit = time.monotonic() + MOST_S
    done, status = os.waitpid(child, os.WNOHANG)
    while not done:
        if time.monotonic() > limit:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            raise TimeoutError(f"the run hangs: {aside.read_text()}")
        time.sleep(0.01)
        done, status = os.waitpid(child, os.WNOHANG)
    if os.WIFSIGNALED(status):
        return End(signal=os.WTERMSIG(status), stderr=aside.read_text())
    return End(**json.loads(told.read_text()), stderr=aside.read_text())


def _run(folder: Path, format_: str, faults: Faults, told: Path, aside: Path) -> None:
    """Be the forked process; it never returns."""
    report, real_open = os.open(told, os.O_CREAT | os.O_WRONLY), os.open
    os.dup2(real_open(aside, os.O_CREAT | os.O_WRONLY | os.O_TRUNC), 2)
    sys.stderr = os.fdopen(2, "w", closefd=False)
    found: dict[str, Any] = {}
    try:
        faults.plant()
        results = process(
            sorted(folder.glob("*.dng")),
            bundle=folder / "tiny.camkit",
            out_dir=folder / "out",
            format=format_,
            resume=True,
        )
        found["files"] = {r.input.stem: [r.status, r.error] for r in results}
    except (CamkitError, OSError, MemoryError) as error:
        found["ended"] = f"{type(error).__name__}: {error}"
    finally:
        sys.stderr.flush()
        os.write(report, json.dumps({**found, "seen": faults.seen}).encode())
        os._exit(0)
