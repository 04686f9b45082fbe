"""What a cluster costs beside one process: seconds a file, overhead, bits, and killed workers.

    python -m tools.batch.cluster --captures 200 --width 600 --height 400 --size S
    python -m tools.batch.cluster --captures 6 --size M              24 megapixels

A dask scheduler and workers with one thread each are processes of this machine. `--jobs` of one
process and the cluster take turns over the same captures, after one round that nobody counts; the
table has every round and the medians. `--kill N` kills a worker after every N results of one more
round; a supervisor starts it again. `-o FILE` keeps what `tools.batch.archive` wants.
"""

import argparse
import contextlib
import json
import os
import random
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import camkit
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.runtime.batch.cluster.connection import connected
from camkit.runtime.network.engine import available_threads
from camkit.runtime.twin.simulate import SimulationOptions, photograph, write_capture
from camkit.scenes import procedural_scene

if TYPE_CHECKING:
    from distributed import Client


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", default="duet")
    parser.add_argument("--size", default="M")
    parser.add_argument("--captures", type=int, default=6)
    parser.add_argument("--width", type=int, default=6000)
    parser.add_argument("--height", type=int, default=4000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--kill", type=int, default=0, metavar="N")
    parser.add_argument("-o", "--output", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = measure(arguments, Path(folder))
    if arguments.output is not None:
        arguments.output.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def measure(wanted: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Return what was measured, printed as it is found."""
    bundle = open_bundle(find_bundle(wanted.bundle))
    captures = folder / "captures"
    captures.mkdir()
    bytes_in = _photograph(captures, bundle, wanted)
    seconds: dict[str, list[float]] = {"jobs": [], "cluster": []}
    with Processes(folder, wanted.workers) as processes, connected(processes.address) as client:
        client.wait_for_workers(wanted.workers, timeout=60)
        ways: dict[str, dict[str, Any]] = {
            "jobs": {"jobs": wanted.workers},
            "cluster": {"client": client, "threads": 1},
        }
        print("| round | way | s | s a file | peak MB |\n|---|---|---|---|---|")
        peaks = dict.fromkeys(ways, 0.0)
        serial: list[tuple[float, float]] = []
        for number in range(wanted.rounds + 1):
            for way, choices in ways.items():
                watch = _Watch(processes)
                results, spent = _process(
                    captures, folder / way, wanted, on_result=watch, **choices
                )
                if way == "cluster" and number:
                    serial.append(watch.each_ms())
                peaks[way] = max(r.peak_rss_mb for r in results)
                name = "warm-up" if number == 0 else str(number)
                each = spent / wanted.captures
                print(
                    f"| {name} | {way} | {spent:.2f} | {each:.3f} | {peaks[way]:.0f} |", flush=True
                )
                if number:
                    seconds[way].append(spent)
        same = _pictures(folder / "jobs") == _pictures(folder / "cluster")
        medians = {way: statistics.median(values) for way, values in seconds.items()}
        ratios = [c / j for c, j in zip(seconds["cluster"], seconds["jobs"], strict=True)]
        overhead_ms = 1e3 * statistics.median(
            (c - j) / wanted.captures
            for c, j in zip(seconds["cluster"], seconds["jobs"], strict=True)
        )
        caller_ms, scheduler_ms = map(statistics.median, zip(*serial, strict=True))
        kills, killed_s = 0, None
        if wanted.kill:
            kills, killed_s = _with_kills(captures, folder, wanted, client, processes)
            same = same and _pictures(folder / "jobs") == _pictures(folder / "killed")
        pictures = list((folder / "cluster").glob("*.exr"))
        found = {
            "bundle": wanted.bundle,
            "size": wanted.size,
            "captures": wanted.captures,
            "side_px": [wanted.width, wanted.height],
            "workers": wanted.workers,
            "seconds": seconds,
            "seconds_a_file_and_worker": medians["cluster"] * wanted.workers / wanted.captures,
            "cluster_over_jobs": statistics.median(ratios),
            "overhead_ms_a_file": overhead_ms,
            "caller_cpu_ms_a_file": caller_ms,
            "scheduler_cpu_ms_a_file": scheduler_ms,
            "peak_mb": peaks["cluster"],
            "bytes_in": bytes_in,
            "bytes_out": round(statistics.mean(p.stat().st_size for p in pictures)),
            "equal_bits": same,
            "kills": kills,
            "seconds_with_kills": killed_s,
        }
    print(
        f"\nmedians: jobs {medians['jobs']:.2f} s, cluster {medians['cluster']:.2f} s, ratio "
        f"{found['cluster_over_jobs']:.3f}; overhead {overhead_ms:.1f} ms a file; CPU of "
        f"caller {caller_ms:.1f} and scheduler {scheduler_ms:.1f} ms a file; bits "
        f"{'equal' if same else 'DIFFER'}"
    )
    if killed_s is not None:
        print(f"{kills} workers killed: {killed_s:.2f} s, every picture made")
    return found


class Processes:
    """A scheduler and workers that are started again when they end."""

    def __init__(self, folder: Path, workers: int) -> None:
        """Return where their logs go and how many there are."""
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self.workers = [f"worker{n}" for n in range(workers)]
        host = ("--host", "127.0.0.1", "--no-dashboard")
        self._commands = {"scheduler": ["scheduler", "--port", str(port), *host]}
        for name in self.workers:
            scratch = str(folder / name)
            self._commands[name] = [
                *("worker", self.address, "--nthreads", "1", *host),
                *("--local-directory", scratch),
            ]
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._supervise, daemon=True)

    def __enter__(self) -> "Processes":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        for name, process in self._running.items():
            self.kill(name)
            process.wait()

    def kill(self, name: str) -> None:
        """Kill a process and what it started, as a machine is lost."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._running[name].pid, signal.SIGKILL)

    def pid_of(self, name: str) -> int:
        """Return the process that has a name now."""
        return self._running[name].pid

    def _supervise(self) -> None:
        while True:
            for name, command in self._commands.items():
                if name not in self._running or self._running[name].poll() is not None:
                    self._running[name] = subprocess.Popen(
                        [sys.executable, "-W", "ignore", "-m", "dask", *command],
                        stdout=subprocess.DEVNULL,
                        stderr=subprocess.DEVNULL,
                        start_new_session=True,
                    )
            if self._ended.wait(0.2):
                return


def _photograph(folder: Path, bundle: Bundle, wanted: argparse.Namespace) -> int:
    """Write captures; give the bytes of one. Each is another exposure's noise of one scene."""
    height, width = wanted.height, wanted.width
    sensor = bundle.manifest.sensor
    scene = procedural_scene(7, height, width)
    origin = ((sensor.width_px - width) // 4 * 2, (sensor.height_px - height) // 4 * 2)
    for number in range(wanted.captures):
        path = folder / f"shot{number:04}.dng"
        if number < 4:  # the noise of four is enough; the others are copies under another name
            options = SimulationOptions(
                iso=400.0,
                seed=number,
                exposure=0.3,
                origin_px=origin,
                workers=available_threads(None),
            )
            write_capture(path, photograph(scene, bundle, options), sensor, bundle.manifest.name)
        else:
            path.write_bytes((folder / f"shot{number % 4:04}.dng").read_bytes())
    return path.stat().st_size


def _process(
    captures: Path, out: Path, wanted: argparse.Namespace, **choices: Any
) -> tuple[list[camkit.FileResult], float]:
    began = time.perf_counter()
    results = camkit.process(
        captures, bundle=wanted.bundle, size=wanted.size, out_dir=out, overwrite=True, **choices
    )
    spent = time.perf_counter() - began
    failed = [f"{r.input}: {r.error}" for r in results if r.status != "ok"]
    if failed:
        raise RuntimeError(f"{len(failed)} of {len(results)} failed: {failed[0]}")
    return results, spent


def _pictures(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.exr"))}


class _Watch:
    """The CPU time of caller (this process) and scheduler between the first result and the last."""

    def __init__(self, processes: Processes) -> None:
        self._processes = processes
        self._seen: list[tuple[float, float]] = []

    def __call__(self, _: camkit.FileResult) -> None:
        import psutil

        times = psutil.Process(self._processes.pid_of("scheduler")).cpu_times()
        self._seen.append((time.process_time(), times.user + times.system))

    def each_ms(self) -> tuple[float, float]:
        """Return what a file took of each."""
        (caller, scheduler), (caller_end, scheduler_end) = self._seen[0], self._seen[-1]
        count = max(1, len(self._seen) - 1)
        return 1e3 * (caller_end - caller) / count, 1e3 * (scheduler_end - scheduler) / count


def _with_kills(
    captures: Path,
    folder: Path,
    wanted: argparse.Namespace,
    client: "Client",
    processes: Processes,
) -> tuple[int, float]:
    """Process while workers are killed; give how many were and the seconds."""
    rng, count = random.Random(1), 0

    def on_result(_: camkit.FileResult) -> None:
        nonlocal count
        count += 1
        if count % wanted.kill == 0:
            processes.kill(rng.choice(processes.workers))

    _, spent = _process(
        captures, folder / "killed", wanted, client=client, threads=1, on_result=on_result
    )
    return count // wanted.kill, spent


if __name__ == "__main__":
    main()
