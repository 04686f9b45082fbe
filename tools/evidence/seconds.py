"""Two checkouts timed in turn on the same captures: noise of a machine meets both alike."""

import json
import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

from tools.evidence.captures import simulate_captures
from tools.evidence.checkout import BOOT, HERE, Checkout, Worker
from tools.evidence.record import job_of
from tools.memory import Captures

START: Final = ("info", "duet", "--json")
"""The command that stands for starting the command line."""


def compare_seconds(roots: tuple[Path, Path], bundles: list[str] | None, rounds: int) -> None:
    """Print the seconds of two checkouts, by bundle, and their ratios.

    Args:
        roots: The checkouts; the first one simulates the captures.
        bundles: Names of built-in bundles; None for those that both have.
        rounds: How often each capture is processed by each checkout.
    """
    with tempfile.TemporaryDirectory() as work, ExitStack() as stack:
        folder = Path(work).resolve()
        first, second = (Checkout(root=root.resolve(), work=folder) for root in roots)
        workers = [stack.enter_context(Worker(checkout)) for checkout in (first, second)]
        print(f"median seconds of {rounds} rounds: A {first.commit}, B {second.commit}")
        print(f"{'':<28}{'A':>9}{'B':>9}{'B / A':>9}")
        ratios = []
        starts = [[c.command(list(START))[1] for c in (first, second)] for _ in range(rounds)]
        ratios.append(_print_ratio("camkit " + " ".join(START), starts))
        for bundle in bundles or sorted({*first.bundles} & {*second.bundles}):
            for capture in simulate_captures(first, bundle)[0]:
                words = {**job_of(bundle, capture, {}), "planned": False}
                pairs = []
                for number in range(rounds + 1):
                    order = workers[:: 1 if number % 2 else -1]
                    seconds: dict[int, Any] = {
                        id(worker): worker.ask(words).get("seconds") for worker in order
                    }
                    if number and None not in seconds.values():  # the first round warms up
                        pairs.append([seconds[id(worker)] for worker in workers])
                if pairs:
                    ratios.append(_print_ratio(f"{bundle} {capture.name}", pairs))
        print(f"median ratio B / A: {statistics.median(ratios):.3f}")


def compare_whole(
    roots: tuple[Path, Path], cases: list[str], rounds: int, *, megapixels: float, threads: int
) -> None:
    """Print what a large photograph takes in two checkouts, in turn, each in a fresh process.

    Args:
        roots: The checkouts; the bundles of this one simulate the captures.
        cases: Each a bundle and a size, as `duet:S`.
        rounds: How often each checkout makes each picture.
        megapixels: Of the photograph.
        threads: Of each run.

    Raises:
        SystemExit: If a run fails.
    """
    with tempfile.TemporaryDirectory() as work:
        first, second = (Checkout(root=root.resolve(), work=Path(work)) for root in roots)
        print(f"{megapixels:g} megapixels, {threads} threads, without files, medians of {rounds}")
        print(f"{'':<28}{first.commit:>9}{second.commit:>9}{'B / A':>9}")
        for case in cases:
            bundle, size = case.split(":")
            place = Path(work, f"{bundle}-{size}")
            place.mkdir()
            captures = Captures(place, bundle, megapixels)
            words = [str(captures.photo), str(captures.bundle), size, str(threads)]
            pairs = []
            for number in range(rounds):
                order = (first, second)[:: 1 if number % 2 else -1]
                answers = {checkout.root: _run_whole(checkout, words) for checkout in order}
                pairs.append([answers[first.root], answers[second.root]])
            for key in ("cpu_s", "clock_s", "peak_mb"):
                _print_ratio(f"{case} {key}", [[one[key] for one in pair] for pair in pairs])
            same = all(a["sum"] == b["sum"] for a, b in pairs)
            print(f"{case} {'same sum' if same else 'OTHER SUM'}")


def _run_whole(checkout: Checkout, words: list[str]) -> dict[str, float]:
    """Run `whole_picture` with a checkout's camkit."""
    process = subprocess.run(
        [sys.executable, "-P", "-c", BOOT, str(HERE), "tools.evidence.whole_picture", *words],
        cwd=checkout.work,
        env=checkout.environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode:
        raise SystemExit(process.stderr)
    answer: dict[str, float] = json.loads(process.stdout.splitlines()[-1])
    return answer


def _print_ratio(name: str, pairs: list[list[float]]) -> float:
    """Print the medians of pairs of seconds; return the median of their ratios."""
    first, second = (statistics.median(some) for some in zip(*pairs, strict=True))
    ratio = statistics.median(b / a for a, b in pairs)
    print(f"{name:<28}{first:>9.3f}{second:>9.3f}{ratio:>9.3f}", flush=True)
    return ratio
