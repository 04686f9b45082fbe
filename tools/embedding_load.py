"""The web service of examples/fastapi under load: damaged uploads, clients that leave, a kill.

    python -m tools.embedding_load --requests 200 --at-once 8 -o docs/results/embedding.json

Starts the example with uvicorn and sends captures of a camera, damaged ones among them, while
clients leave and one worker is killed. Every answer is compared with what it must be: a picture
with the bytes that camkit writes here, or a status with a reason. Memory is the proportional set
size of a worker with its decoder, sampled. Needs fastapi and uvicorn.
"""

import argparse
import http.client
import itertools
import json
import os
import random
import resource
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import camkit
from camkit.report.bench.machine import describe_machine
from camkit.runtime.batch.pool_process import PROCESS
from camkit.runtime.files.decoder import camkit_environment
from tools.memory import process_tree, pss_mb

BUNDLE: Final = "duet"
"""The camera of the example."""
EXAMPLE: Final = Path(__file__).resolve().parents[1] / "examples" / "fastapi"
SMALL_PX, LARGE_PX = (480, 320), (1500, 1000)
"""Of the captures; one in twenty is large."""
TURN: Final = 20
"""Of so many uploads in turn one leaves, one is large, and four are damaged."""
POLL_S, WATCH_S = 0.1, 0.25
START_S: Final = 60.0
ANSWER_S: Final = 300.0
REFUSED: Final = frozenset({408, 413, 422})
EITHER: Final = REFUSED | {200}
"""Answers to a capture whose bits were turned: it may still be read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Upload:
    """The bytes of a client, and the answers that it may get.

    Attributes:
        kind: For the table.
        name: Whose suffix says what it is.
        data: The bytes.
        picture: The JPEG that must come back, where there must be one.
        statuses: What may come back.
        sent_share: Share of the bytes after which the client leaves; 1 leaves behind the last.
    """

    kind: str
    name: str
    data: bytes
    picture: bytes | None = None
    statuses: frozenset[int] = REFUSED
    sent_share: float | None = None


@dataclass(slots=True, kw_only=True)
class Tally:
    """The answers that came back.

    Attributes:
        answers: (kind, status) -> how often; status 0 for clients that left.
        wrong: Answers that must not be.
        busy: Answers 503, after which the client came again.
        seconds: From the first try to each picture.
        reasons: Kind -> one message of the service.
        shares: Progress that was asked for.
    """

    answers: Counter[tuple[str, int]] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    busy: int = 0
    seconds: list[float] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)
    shares: set[float] = field(default_factory=set)
    lock: Any = field(default_factory=threading.Lock)


class WorkerWatch:
    """The largest memory of each worker of a server with its children, sampled, in MB."""

    def __init__(self, pid: int) -> None:
        self.peaks_mb: dict[int, float] = {}
        self.server_mb = 0.0
        self._pid = pid
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End sampling."""
        self._stopped.set()
        self._thread.join()

    def _sample(self) -> None:
        while not self._stopped.wait(WATCH_S):
            self.server_mb = max(self.server_mb, pss_mb(self._pid))
            for pid in worker_pids(self._pid):
                total = sum(map(pss_mb, process_tree(pid)))
                self.peaks_mb[pid] = max(self.peaks_mb.get(pid, 0.0), total)


def main(words: Sequence[str] | None = None) -> None:
    """Run the load, print the record, and end with 1 if anything was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=200)
    parser.add_argument("--at-once", type=int, default=8)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("-o", "--out", type=Path)
    arguments = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as folder:
        uploads = plan_uploads(arguments, Path(folder))
        temporary = Path(folder) / "temporary"
        temporary.mkdir()
        before_s = children_cpu_s()
        with serve(temporary) as (process, port):
            record = load(process, port, uploads, arguments.at_once)
        record["service_cpu_seconds"] = round(children_cpu_s() - before_s, 1)
        record["files_left"] = sorted(path.name for path in temporary.iterdir())
    command = f"python -m tools.embedding_load --requests {arguments.requests}"
    record |= {"command": f"{command} --at-once {arguments.at_once}", "bundle": BUNDLE}
    record["machine"] = describe_machine()
    text = json.dumps(record, indent=1)
    print(text)
    if arguments.out is not None:
        arguments.out.write_text(text + "\n", encoding="utf-8")
    if record["wrong"] or record["files_left"]:
        raise SystemExit(1)


def children_cpu_s() -> float:
    """Return the processor time of children that have ended, and of theirs."""
    times = resource.getrusage(resource.RUSAGE_CHILDREN)
    return times.ru_utime + times.ru_stime


def plan_uploads(arguments: argparse.Namespace, folder: Path) -> list[Upload]:
    """Return what clients send, in random order."""
    rng = random.Random(arguments.seed)
    small, large = (capture(px, folder) for px in (SMALL_PX, LARGE_PX))
    bad = itertools.cycle(damaged(small.data, rng))
    shares = itertools.cycle((0.5, 1.0))
    uploads = []
    for number in range(arguments.requests):
        place = number % TURN
        if place == 0:
            uploads.append(leaving(small, next(shares)))
        elif place == 1:
            uploads.append(large)
        else:
            uploads.append(next(bad) if place % 5 == 2 else small)
    rng.shuffle(uploads)
    return uploads


def capture(size_px: tuple[int, int], folder: Path) -> Upload:
    """Return a simulated capture with the picture that camkit makes of it in this process."""
    name = f"{size_px[0]}x{size_px[1]}.dng"
    path = folder / name
    camkit.simulate("procedural:7", BUNDLE, path, size_px=size_px, iso=200)
    (result,) = camkit.process(
        path, bundle=BUNDLE, size="S", format="jpeg", out_dir=folder / "made"
    )
    if result.output is None:
        raise SystemExit(f"{name}: {result.error}")
    picture = result.output.read_bytes()
    return Upload(
        kind=f"capture {size_px[0]}x{size_px[1]}",
        name=name,
        data=path.read_bytes(),
        picture=picture,
        statuses=frozenset({200}),
    )


def leaving(upload: Upload, share: float) -> Upload:
    """Return an upload whose client leaves after a share of its bytes."""
    kind = "client leaves in its upload" if share < 1 else "client leaves behind its upload"
    return Upload(kind=kind, name=upload.name, data=upload.data, sent_share=share)


def damaged(data: bytes, rng: random.Random) -> list[Upload]:
    """Return damaged files: each must be refused, or read where bits alone were turned."""

    def turned(start: int, end: int, count: int) -> bytes:
        copy = bytearray(data)
        for place in rng.sample(range(start, end), count):
            copy[place] ^= 1 << rng.randrange(8)
        return bytes(copy)

    half, noise = data[: len(data) // 2], rng.randbytes(20_000)
    plain = [
        ("half a file", "a.dng", half),
        ("no byte", "a.dng", b""),
        ("noise", "a.dng", noise),
        ("noise behind a head", "a.dng", data[:200] + noise),
        ("text", "a.tif", b"not a picture\n" * 100),
        ("half a PNG", "a.png", b"\x89PNG\r\n\x1a\n" + noise),
        ("noise as EXR", "a.exr", b"\x76\x2f\x31\x01\x02\0\0\0" + noise),
        ("unknown suffix", "a.doc", noise),
    ]
    turned_bits = [
        ("bits turned in the tags", turned(0, 2000, 20)),
        ("bits turned in the samples", turned(2000, len(data), 200)),
    ]
    return [Upload(kind=kind, name=name, data=sent) for kind, name, sent in plain] + [
        Upload(kind=kind, name="a.dng", data=sent, statuses=EITHER) for kind, sent in turned_bits
    ]


@contextmanager
def serve(temporary: Path) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """Start the example, and end it behind the block.

    Raises:
        SystemExit: If it does not answer.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    words = ["--app-dir", str(EXAMPLE), "app:app", "--port", str(port), "--log-level", "warning"]
    environment = camkit_environment() | {"TMPDIR": str(temporary)}
    with subprocess.Popen([sys.executable, "-m", "uvicorn", *words], env=environment) as process:
        try:
            wait_until_ready(process, port)
            yield process, port
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(timeout=START_S)


def wait_until_ready(process: subprocess.Popen[bytes], port: int) -> None:
    """Poll the server until it answers.

    Raises:
        SystemExit: If the server ends, or does not answer in time.
    """
    end = time.monotonic() + START_S
    while process.poll() is None and time.monotonic() < end:
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=1):
                return
        except OSError:
            time.sleep(POLL_S)
    raise SystemExit("the example does not start; see above")


def worker_pids(server_pid: int) -> list[int]:
    """Return the worker processes of a server."""
    pids = []
    for task in Path(f"/proc/{server_pid}/task").glob("*/children"):
        try:
            children = [int(word) for word in task.read_text().split()]
            pids += [pid for pid in children if PROCESS in _command_line(pid)]
        except OSError:
            continue
    return pids


def _command_line(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace")


def load(
    process: subprocess.Popen[bytes], port: int, uploads: Sequence[Upload], at_once: int
) -> dict[str, Any]:
    """Send all uploads, so many at once, kill one worker half way, and return what came back."""
    tally, watch, began = Tally(), WorkerWatch(process.pid), time.monotonic()
    with ThreadPoolExecutor(at_once) as clients:
        futures = [
            clients.submit(send, port, number, upload, tally)
            for number, upload in enumerate(uploads)
        ]
        futures[len(futures) // 2].result()
        workers = worker_pids(process.pid)
        os.kill(workers[0], signal.SIGKILL)
        for future in futures:
            future.result()
    seconds = time.monotonic() - began
    last = next(upload for upload in uploads if upload.picture is not None)
    for number, _ in enumerate(workers, len(uploads)):
        send(port, number, last, tally)  # it still serves, by each worker
    workers = worker_pids(process.pid)
    watch.stop()
    return {
        "requests": len(uploads),
        "at_once": at_once,
        "seconds": round(seconds, 1),
        "answers": [
            {"kind": kind, "status": status, "count": count}
            for (kind, status), count in sorted(tally.answers.items())
        ],
        "wrong": tally.wrong,
        "busy_answers": tally.busy,
        "picture_seconds_median": round(statistics.median(tally.seconds), 2),
        "picture_seconds_most": round(max(tally.seconds), 2),
        "progress_values": len(tally.shares),
        "reasons": dict(sorted(tally.reasons.items())),
        "workers_killed": 1,
        "workers_at_the_end": len(workers),
        "worker_peaks_mb": sorted(round(peak) for peak in watch.peaks_mb.values()),
        "server_peak_mb": round(watch.server_mb),
    }


def send(port: int, number: int, upload: Upload, tally: Tally) -> None:
    """Send one upload, again where every place is taken, and count what came back."""
    began, key = time.monotonic(), f"{number}-{upload.name}"
    if upload.sent_share is not None:
        leave(port, key, upload)
        with tally.lock:
            tally.answers[upload.kind, 0] += 1
        return
    while True:
        status, headers, body = exchange(port, key, upload.data, tally)
        if status != 503:
            break
        with tally.lock:
            tally.busy += 1
        time.sleep(float(headers["retry-after"]))
    with tally.lock:
        tally.answers[upload.kind, status] += 1
        if status == 200:
            tally.seconds.append(time.monotonic() - began)
        else:
            tally.reasons[upload.kind] = str(json.loads(body)["detail"])
        if status not in upload.statuses or upload.picture not in (None, body):
            tally.wrong.append(f"{upload.kind}: {status}, {len(body)} bytes {body[:200]!r}")


def exchange(port: int, key: str, data: bytes, tally: Tally) -> tuple[int, dict[str, str], bytes]:
    """Send bytes, ask for progress meanwhile, and return status, headers and body."""
    is_answered = threading.Event()
    asking = threading.Thread(target=ask_progress, args=(port, key, tally, is_answered))
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=ANSWER_S)
    asking.start()
    try:
        connection.request("PUT", f"/captures/{key}", data)
        answer = connection.getresponse()
        headers = {name.lower(): value for name, value in answer.getheaders()}
        return answer.status, headers, answer.read()
    finally:
        is_answered.set()
        asking.join()
        connection.close()


def ask_progress(port: int, key: str, tally: Tally, is_answered: threading.Event) -> None:
    """Request the progress of a capture every half second; it may not be under way."""
    while not is_answered.wait(0.5):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=ANSWER_S)
        try:
            connection.request("GET", f"/captures/{key}")
            answer = connection.getresponse()
            body = answer.read()
        finally:
            connection.close()
        if answer.status == 200:
            work = json.loads(body)  # None before its upload, and behind it
            with tally.lock:
                tally.shares |= set() if work is None else {work[0] / work[1]}


def leave(port: int, key: str, upload: Upload) -> None:
    """Send a share of an upload, and close the connection."""
    count = round(len(upload.data) * (upload.sent_share or 0.0))
    head = f"PUT /captures/{key} HTTP/1.1\r\nHost: example\r\nContent-Length: {len(upload.data)}"
    with socket.create_connection(("127.0.0.1", port), timeout=ANSWER_S) as connection:
        connection.sendall(f"{head}\r\n\r\n".encode() + upload.data[:count])
        time.sleep(2 * POLL_S)


if __name__ == "__main__":
    main()
