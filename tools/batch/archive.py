r"""What an archive costs on many cores, and what breaks first: the queue of a cluster simulated.

    python -m tools.batch.archive --file docs/results/cluster/24mp.json \
        --queue docs/results/cluster/small.json --captures 10_000_000

Event by event: a free core takes the next file once the caller and the scheduler have had their
time for it (one after the other, for all files), reads it, computes, writes the picture. Storage is
one queue of so many bytes a second, a stream no faster than --stream. Seconds vary from file to
file (log-normal), some files are stragglers, workers die and their files are made again. Seconds,
bytes and CPU times come from files of `tools.batch.cluster`; a run simulates --simulated files
and goes on at the rate of its middle.
"""

import argparse
import heapq
import json
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

READ, COMPUTE, WRITE, DONE = range(4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """What every file asks for, and what there is.

    Attributes:
        cores: Files in the making at once, each on a core.
        seconds: Of a file on a core, median.
        spread: Standard deviation of their logarithm.
        stragglers: Share of files that take `straggler` times as long.
        straggler: That factor.
        bytes_in: Of a capture.
        bytes_out: Of a picture.
        storage: Bytes a second of the storage in all.
        stream: Bytes a second of one file at most.
        queue_s: Seconds that caller and scheduler need for a file, the slower of the two.
        deaths: Of a worker in an hour.
        restart_s: Until a worker that died is back.
    """

    cores: int
    seconds: float
    spread: float = 0.2
    stragglers: float = 1e-3
    straggler: float = 10.0
    bytes_in: float
    bytes_out: float
    storage: float = 5e9
    stream: float = 2e8
    queue_s: float
    deaths: float = 1e-3
    restart_s: float = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a simulation found.

    Attributes:
        files_a_s: In the middle of the run.
        hours: Of the whole archive.
        cores_busy: Share of the cores' time that is computing, in the middle of the run.
        storage_busy: Share of the storage's bytes a second that go through it then.
        queue_busy: Share of the time of caller and scheduler then, the slower of the two.
        tail_s: From the moment when nothing waited any more to the end.
        again: Share of files that were made again.
    """

    files_a_s: float
    hours: float
    cores_busy: float
    storage_busy: float
    queue_busy: float
    tail_s: float
    again: float

    @property
    def limit(self) -> str:
        """Name what the rate is limited by."""
        shares = {
            "cores": self.cores_busy,
            "storage": self.storage_busy,
            "scheduler": self.queue_busy,
        }
        return max(shares, key=lambda key: shares[key])


class Simulation:
    """The queue of one run."""

    def __init__(self, load: Load, seed: int) -> None:
        """Begin with every core free."""
        self._load = load
        self._rng = random.Random(seed)
        self._queue_free = self._storage_free = 0.0
        self._computed_s = 0.0
        self._again = 0

    def run(self, files: int, archive: int) -> Outcome:
        """Make `files` files; give what an archive of `archive` takes."""
        events: list[tuple[float, int, int]] = []
        left = files
        for core in range(min(self._load.cores, files)):
            heapq.heappush(events, (self._handed_out(0.0), READ, core))
            left -= 1
        done: list[float] = []
        nothing_waits = 0.0
        while events:
            now, kind, core = heapq.heappop(events)
            if kind == READ:
                heapq.heappush(events, (self._moved(now, self._load.bytes_in), COMPUTE, core))
            elif kind == COMPUTE:
                heapq.heappush(events, (self._computed(now), WRITE, core))
            elif kind == WRITE:
                heapq.heappush(events, (self._moved(now, self._load.bytes_out), DONE, core))
            else:
                done.append(now)
                if left:
                    left -= 1
                    nothing_waits = now
                    heapq.heappush(events, (self._handed_out(now), READ, core))
        return self._outcome(done, nothing_waits, archive)

    def _handed_out(self, now: float) -> float:
        self._queue_free = max(now, self._queue_free) + self._load.queue_s
        return self._queue_free

    def _moved(self, now: float, size: float) -> float:
        """Return when bytes have gone through the storage."""
        alone = size / self._load.storage
        self._storage_free = max(now, self._storage_free) + alone
        return max(self._storage_free, now + size / self._load.stream)

    def _computed(self, now: float) -> float:
        """Return when a file has been computed, again and again if its worker dies."""
        load = self._load
        seconds = load.seconds * math.exp(self._rng.gauss(0, load.spread))
        if self._rng.random() < load.stragglers:
            seconds *= load.straggler
        while load.deaths and (life := self._rng.expovariate(load.deaths / 3600)) < seconds:
            self._again += 1
            now += life + load.restart_s
        self._computed_s += seconds
        return now + seconds

    def _outcome(self, done: list[float], nothing_waits: float, archive: int) -> Outcome:
        first, last = done[len(done) // 4], done[3 * len(done) // 4]
        rate = (3 * len(done) // 4 - len(done) // 4) / max(last - first, 1e-9)
        wall_s, load = done[-1], self._load
        return Outcome(
            files_a_s=rate,
            hours=(wall_s + max(archive - len(done), 0) / rate) / 3600,
            cores_busy=rate * self._computed_s / (len(done) * load.cores),
            storage_busy=rate * (load.bytes_in + load.bytes_out) / load.storage,
            queue_busy=rate * load.queue_s,
            tail_s=wall_s - nothing_waits,
            again=self._again / len(done),
        )


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--file", type=Path, required=True, help="of tools.batch.cluster: what one is"
    )
    parser.add_argument("--queue", type=Path, required=True, help="one of many files: the queue")
    parser.add_argument("--captures", type=int, default=10_000_000)
    parser.add_argument("--cores", default="100,300,1000,3000,10000")
    parser.add_argument("--simulated", type=int, default=200_000)
    parser.add_argument("--storage", type=float, default=5.0, help="GB a second in all")
    parser.add_argument("--stream", type=float, default=0.2, help="GB a second of one file")
    parser.add_argument("--stragglers", type=float, default=1e-3, help="share of files")
    parser.add_argument("--deaths", type=float, default=1e-3, help="of a worker in an hour")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    load = replace(
        measured_load(arguments.file, arguments.queue),
        storage=1e9 * arguments.storage,
        stream=1e9 * arguments.stream,
        stragglers=arguments.stragglers,
        deaths=arguments.deaths,
    )
    print(
        f"a file: {load.seconds:.2f} s on a core, {load.bytes_in / 1e6:.1f} MB in, "
        f"{load.bytes_out / 1e6:.1f} MB out, {1e3 * load.queue_s:.1f} ms of the queue"
    )
    for line in table(load, [int(n) for n in arguments.cores.split(",")], arguments):
        print(line, flush=True)


def table(load: Load, cores: list[int], wanted: argparse.Namespace) -> Iterator[str]:
    """Return the lines of the table."""
    yield (
        "| cores | files/s | hours | core hours | cores busy | storage busy | queue busy | "
        "tail s | made again | limit |"
    )
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for count in cores:
        files = max(wanted.simulated, 20 * count)
        found = Simulation(replace(load, cores=count), wanted.seed).run(files, wanted.captures)
        shares = " | ".join(
            f"{100 * share:.0f} %"
            for share in (found.cores_busy, found.storage_busy, found.queue_busy)
        )
        yield (
            f"| {count} | {found.files_a_s:.1f} | {found.hours:.0f} | {found.hours * count:.0f} | "
            f"{shares} | {found.tail_s:.0f} | {100 * found.again:.4f} % | {found.limit} |"
        )


def measured_load(file: Path, queue: Path) -> Load:
    """Read what `tools.batch.cluster` measured."""
    found = json.loads(file.read_text(encoding="utf-8"))
    many = json.loads(queue.read_text(encoding="utf-8"))
    queue_ms = max(many["caller_cpu_ms_a_file"], many["scheduler_cpu_ms_a_file"])
    return Load(
        cores=1,
        seconds=found["seconds_a_file_and_worker"],
        bytes_in=found["bytes_in"],
        bytes_out=found["bytes_out"],
        queue_s=queue_ms / 1e3,
    )


if __name__ == "__main__":
    main()
