"""`camkit process` on a cluster: results, exit codes, interrupts, addresses that are none."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from tests.camkit.cli.conftest import Command
from tests.capture_factory import write_tiny_captures
from tests.runtime.batch.cluster.farm import Farm, free_port, wait_until


@pytest.fixture(scope="module")
def farm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    with Farm(tmp_path_factory.mktemp("farm")) as farm:
        farm.add_worker("one", threads=2)
        farm.wait(1)
        yield farm


def test_a_file_that_fails_ends_with_one_and_the_others_are_made(
    captures: Path, farm: Farm, camkit_command: Command
) -> None:
    (captures / "broken.dng").write_bytes(b"not a picture")
    command = (
        *("process", captures, captures / "missing.dng", "--json"),
        *("--bundle", captures / "tiny.camkit", "--out-dir", captures / "out"),
        *("--scheduler", farm.address),
    )
    done = camkit_command(*command)
    told = {Path(one["input"]).name: one for one in map(json.loads, done.out.splitlines())}
    assert done.code == 1
    assert {name: one["status"] for name, one in told.items()} == {
        **{f"{name}.dng": "ok" for name in "ab"},
        "broken.dng": "failed",
        "missing.dng": "failed",
    }
    assert "broken.dng" in told["broken.dng"]["error"]
    again = camkit_command(*command, "--resume")
    statuses = [json.loads(line)["status"] for line in again.out.splitlines()]
    assert (again.code, statuses.count("skipped")) == (1, 2)


def test_workers_of_its_own(captures: Path, camkit_command: Command) -> None:
    done = camkit_command(
        *("process", captures, "--bundle", captures / "tiny.camkit", "--out-dir", captures / "out"),
        *("--workers", 1, "--json"),
    )
    assert (done.code, len(done.out.splitlines())) == (0, 2)
    assert [json.loads(line)["status"] for line in done.out.splitlines()] == ["ok", "ok"]
    assert len(list((captures / "out").iterdir())) == 4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--workers", 0), "workers must be >= 1"),
        (("--workers", 1, "--scheduler", "tcp://127.0.0.1:1"), "leave --workers out"),
        (("--workers", 1, "--jobs", 2), "--jobs are those of one process"),
        (("--scheduler", "nonsense"), "missing port number"),
        (("--scheduler", "foo://host:1"), "unknown address scheme"),
        (("--scheduler", "tls://127.0.0.1:1"), "distributed.comm.tls"),
    ],
)
def test_what_makes_no_sense_is_one_line(
    captures: Path, camkit_command: Command, options: tuple[object, ...], message: str
) -> None:
    done = camkit_command("process", captures, "--bundle", captures / "tiny.camkit", *options)
    assert done.code == 2
    assert message in done.err
    assert len(done.err.splitlines()) == 1


class _Foreign(BaseHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


@pytest.mark.parametrize(
    "service",
    ["silence", *(pytest.param(n, marks=pytest.mark.slow) for n in ("nobody", "http", "a worker"))],
)
def test_an_address_without_a_scheduler_is_one_line_within_ten_seconds(
    captures: Path, farm: Farm, service: str
) -> None:
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    if service == "silence":
        silent = socket.create_server(("127.0.0.1", port))
    elif service == "http":
        server = HTTPServer(("127.0.0.1", port), _Foreign)
        threading.Thread(target=server.serve_forever, daemon=True).start()
    elif service == "a worker":
        with farm.client() as client:
            address = next(iter(client.scheduler_info()["workers"]))
    began = time.monotonic()
    done = subprocess.run(
        _process(captures, "--scheduler", address), capture_output=True, text=True, check=False
    )
    assert time.monotonic() - began < 15, "ten on a machine that does nothing else"
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"camkit: no dask scheduler answers at {address}: ")
    assert len(done.stderr.splitlines()) == 1
    if service == "silence":
        silent.close()
    elif service == "http":
        server.shutdown()
        server.server_close()


def test_a_scheduler_without_workers_is_refused(captures: Path, tmp_path: Path) -> None:
    with Farm(tmp_path / "empty") as empty:
        with empty.client():
            pass
        done = subprocess.run(
            _process(captures, "--scheduler", empty.address),
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 2
    assert "has no workers" in done.stderr


@pytest.fixture
def heeds_interrupts() -> Iterator[None]:
    """What a shell runs in the background ignores interrupts, and its children inherit that."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeds_interrupts")
@pytest.mark.parametrize("when", ["starting", "working"])
def test_an_interrupt_ends_it_in_seconds_and_leaves_nothing_half_done(
    tmp_path: Path, when: str
) -> None:
    # so many that they are not done before the signal comes on a busy machine
    write_tiny_captures(tmp_path, [f"shot{n:02}" for n in range(60)])
    out = tmp_path / "out"
    process = subprocess.Popen(
        _process(tmp_path, "--workers", "2"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    if when == "working":
        wait_until(lambda: list(out.glob("*.exr")))
    else:
        time.sleep(2.0)
    began = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to every process
    _, told = process.communicate(timeout=60)
    assert time.monotonic() - began < 40
    assert process.returncode == 130, told
    assert told.splitlines()[-1] == "camkit: interrupted"
    assert "Traceback" not in told
    if out.exists():
        names = sorted(path.name for path in out.iterdir())
        whole = [name.removesuffix(".exr") for name in names if name.endswith(".exr")]
        assert names == sorted(f"{n}{suffix}" for n in whole for suffix in (".exr", ".camkit.json"))


def test_workers_give_up_the_files_of_a_caller_that_is_killed(tmp_path: Path, farm: Farm) -> None:
    write_tiny_captures(tmp_path, [f"shot{n:02}" for n in range(12)])
    out = tmp_path / "out"
    caller = subprocess.Popen(_process(tmp_path, "--scheduler", farm.address))
    wait_until(lambda: list(out.glob("*.exr")))
    caller.send_signal(signal.SIGKILL)
    caller.wait()
    made = len(list(out.glob("*.exr")))
    wait_until(lambda: not list(out.glob("*.exr.claim")), seconds=20)
    assert len(list(out.glob("*.exr"))) <= made + 4, "no more than those that were under way"
    assert len(list(out.glob("*.camkit.json"))) == len(list(out.glob("*.exr")))

    (token,) = out.glob(".camkit-run-*")
    os.utime(token, (0, 0))
    done = subprocess.run(_process(tmp_path, "--scheduler", farm.address, "--resume"), check=False)
    names = [path.suffix for path in out.iterdir()]
    assert (done.returncode, len(names), names.count(".exr")) == (0, 24, 12)


def _process(folder: Path, *options: str) -> list[str]:
    return [
        *(sys.executable, "-m", "camkit", "process", f"{folder}/*.dng"),
        *("--bundle", str(folder / "tiny.camkit"), "--out-dir", str(folder / "out"), *options),
    ]
