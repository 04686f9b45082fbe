"""One fresh process watched: seconds until its pictures lie there, memory of its tree, load.

start ---------------- first picture ------- second picture --- end
  | interpreter, imports, | steady: all is ready |
  | bundle, session, work |
  | memory of the tree, load of others watched   |
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import IO, Any, Final

from camkit.runtime.files.decoder import camkit_environment

POLL_S: Final = 0.02
TIMEOUT_S: Final = 3600.0
REPEAT_WITHIN_S: Final = 60.0
"""A file that takes longer is not repeated: what a process pays once does not show in it."""
SILENT: Final = "the process ended without a picture and without a word"
_PROC: Final = Path("/proc")


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """Work of one worker.

    Attributes:
        files: Captures; their names differ.
        bundle: Path of the bundle, or "none".
        out_dir: Folder of the pictures.
        options: Fields of `Options`, plain JSON values.
        repeat_within_s: The process ends early once a file has taken longer.
    """

    files: tuple[Path, ...]
    bundle: str
    out_dir: Path
    options: dict[str, Any]
    repeat_within_s: float = REPEAT_WITHIN_S

    def to_json(self) -> str:
        """Encode for the worker's command line."""
        return json.dumps(
            {
                "files": [str(file) for file in self.files],
                "bundle": self.bundle,
                "out_dir": str(self.out_dir),
                "options": self.options,
                "repeat_within_s": self.repeat_within_s,
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Measurements of one process.

    Attributes:
        seconds: From the start of the process to its first picture; None if there is none.
        cpu_s: Processor time of the process and its children until then.
        stages: Seconds per stage of the first picture.
        steady_s: Seconds of each further picture.
        steady_cpu_s: Processor time of each further picture.
        peak_rss_mb: Largest sum over the process and its children until the first picture.
        load_of_others: Share of the machine's processor time that others took until then.
        error: Why there is no picture.
    """

    seconds: float | None = None
    cpu_s: float | None = None
    stages: dict[str, float] = field(default_factory=dict)
    steady_s: tuple[float, ...] = ()
    steady_cpu_s: tuple[float, ...] = ()
    peak_rss_mb: float | None = None
    load_of_others: float | None = None
    error: str | None = None


def run_job(job: Job) -> Run:
    """Run a job in a fresh process, which is ended with all its children if we are interrupted."""
    command = [sys.executable, "-P", "-m", "camkit.report.bench.timed.worker", job.to_json()]
    with tempfile.TemporaryFile() as complaints:
        busy_start_s, began = _busy_s(), time.perf_counter()
        with subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=complaints,
            env=camkit_environment(),
            start_new_session=True,
        ) as child:
            timer = threading.Timer(TIMEOUT_S, _end, (child,))
            timer.start()
            try:
                run = _follow(child, began, busy_start_s)
            finally:
                expired = not timer.is_alive()
                timer.cancel()
                _end(child)
        if expired:
            return Run(error=f"it took longer than {TIMEOUT_S:g} s and was ended")
        return run if run.error != SILENT else Run(error=_last_words(complaints))


def _follow(child: subprocess.Popen[bytes], began: float, busy_before: float | None) -> Run:
    """Read the worker's lines while its memory is watched."""
    watch = TreeWatch(child.pid)
    watch.start()
    records: list[dict[str, Any]] = []
    arrivals: list[float] = []
    load: float | None = None
    assert child.stdout is not None
    try:
        for line in child.stdout:
            arrivals.append(time.perf_counter())
            records.append(json.loads(line))
            if len(records) == 1:
                watch.stop()
                elapsed = arrivals[0] - began
                load = _load_of_others(busy_before, _busy_s(), records[0]["cpu_s"], elapsed)
    finally:
        watch.stop()
    failed = next((r["error"] for r in records if r["status"] != "ok"), None)
    if failed is not None or not records or child.wait():
        return Run(error=failed or SILENT)
    worker_peak_mb = records[0]["peak_rss_mb"]
    cpu = [record["cpu_s"] for record in records]
    return Run(
        seconds=arrivals[0] - began,
        cpu_s=cpu[0],
        stages=records[0]["seconds"],
        steady_s=_steps(arrivals),
        steady_cpu_s=_steps(cpu),
        peak_rss_mb=max(worker_peak_mb, watch.peak_mb) or None,
        load_of_others=load,
    )


def _steps(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(b - a for a, b in pairwise(values))


def _last_words(complaints: IO[bytes]) -> str:
    """Return the last line that the worker wrote on stderr."""
    complaints.seek(max(0, complaints.seek(0, os.SEEK_END) - 4096))
    lines = complaints.read().decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else SILENT


def _end(child: subprocess.Popen[bytes]) -> None:
    """End the worker and its children, if they still run."""
    if child.poll() is None:
        if hasattr(os, "killpg"):
            os.killpg(child.pid, signal.SIGKILL)
        else:
            child.kill()


class TreeWatch:
    """The largest resident memory of a process and all its descendants, sampled.

    Pages that two processes share count twice, as the mosaic does that a decoder hands over.
    """

    def __init__(self, pid: int) -> None:
        self.peak_mb = 0.0
        self._pid = pid
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._sample, name="camkit-watch", daemon=True)

    def start(self) -> None:
        """Start to sample every `POLL_S`."""
        self._thread.start()

    def stop(self) -> None:
        """End sampling; may be called again."""
        self._stopped.set()
        self._thread.join()

    def _sample(self) -> None:
        while not self._stopped.wait(POLL_S):
            self.peak_mb = max(self.peak_mb, tree_rss_mb(self._pid))


def tree_rss_mb(pid: int) -> float:
    """Return the resident memory of a process and its descendants, in MB; 0 if unknown."""
    total, waiting = 0, [pid]
    while waiting:
        one = waiting.pop()
        try:
            resident = (_PROC / str(one) / "statm").read_text(encoding="ascii").split()[1]
            tasks = list((_PROC / str(one) / "task").iterdir())
            texts = [(task / "children").read_text(encoding="ascii") for task in tasks]
        except (OSError, IndexError):
            continue  # it ended meanwhile, or this system has no /proc
        total += int(resident) * os.sysconf("SC_PAGE_SIZE")
        waiting += [int(word) for text in texts for word in text.split()]
    return total / 1e6


def _busy_s() -> float | None:
    """Return the processor time that the machine has spent so far; None where it does not tell."""
    try:
        line = (_PROC / "stat").read_text(encoding="ascii").splitlines()[0].split()
        user, nice, system, _idle, _iowait, irq, softirq, steal = map(int, line[1:9])
    except (OSError, ValueError, IndexError):
        return None
    return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")


def _load_of_others(
    before: float | None, after: float | None, own_s: float, elapsed_s: float
) -> float | None:
    """Return the share of the machine's processor time that was neither idle nor the run's own."""
    if before is None or after is None or elapsed_s <= 0:
        return None
    others = after - before - own_s
    return min(max(others / (elapsed_s * (os.cpu_count() or 1)), 0.0), 1.0)
