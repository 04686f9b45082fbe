"""Numbered hostile bundles tried in children: what they end in, and what no bundle may do."""

import json
import os
import selectors
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MOST_SECONDS = 60.0
"""For a case: far above what the limits of the child let it take, on a busy machine too."""
MOST_MB = 930.0
"""The cap of the runtime where nobody names one."""
START_SECONDS = 120.0


@dataclass(slots=True)
class Outcome:
    """What became of many cases.

    Attributes:
        ends: How many ended in which way.
        faults: Seed -> what happened.
        slowest_s: Seconds of the slowest case.
        peak_mb: Memory of the largest.
    """

    ends: Counter[str] = field(default_factory=Counter)
    faults: dict[int, str] = field(default_factory=dict)
    slowest_s: float = 0.0
    peak_mb: float = 0.0

    def line(self) -> str:
        """Sum up in one line."""
        ends = ", ".join(f"{count} {end}" for end, count in sorted(self.ends.items()))
        return (
            f"{sum(self.ends.values())} hostile bundles: {ends}; slowest {self.slowest_s:.1f} s, "
            f"largest {self.peak_mb:.0f} MB; {len(self.faults)} faults"
        )


def try_seeds(first: int, count: int) -> Outcome:
    """Try numbered cases; a child that hangs or dies costs the case it was at."""
    outcome = Outcome()
    while count > 0:
        reached = _try_until_a_fault(first, count, outcome)
        count -= reached + 1 - first
        first = reached + 1
    return outcome


def _try_until_a_fault(first: int, count: int, outcome: Outcome) -> int:
    """Try cases in one child until it ends; give the last case that it began."""
    child = subprocess.Popen(
        [sys.executable, "-m", "tests.hostile.child", str(first), str(count)],
        stdout=subprocess.PIPE,
        cwd=ROOT,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    assert child.stdout is not None
    seed, open_case, limit_s = first, True, START_SECONDS
    with selectors.DefaultSelector() as ready, child:
        ready.register(child.stdout, selectors.EVENT_READ)
        while ready.select(limit_s) and (line := child.stdout.readline()):
            told, limit_s = json.loads(line), MOST_SECONDS
            open_case = "seed" in told
            if open_case:
                seed = told["seed"]
            else:
                _note(outcome, seed, told)
        hung = child.poll() is None and open_case
        child.kill() if hung else None
    if open_case or child.returncode:
        what = f"no end within {limit_s:.0f} s" if hung else f"exit code {child.returncode}"
        outcome.faults[seed] = what
        outcome.ends["fault"] += 1
    return seed


def _note(outcome: Outcome, seed: int, told: dict[str, object]) -> None:
    end, seconds, peak_mb = (
        str(told["end"]),
        float(str(told["seconds"])),
        float(str(told["peak_mb"])),
    )
    outcome.slowest_s = max(outcome.slowest_s, seconds)
    outcome.peak_mb = max(outcome.peak_mb, peak_mb)
    if "\n" in end:
        outcome.faults[seed] = end
    elif peak_mb > MOST_MB:
        outcome.faults[seed] = f"{end}, but it took {peak_mb:.0f} MB"
    outcome.ends["fault" if seed in outcome.faults else end] += 1
