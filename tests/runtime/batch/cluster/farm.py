"""A scheduler and workers as processes of this machine, to be killed and started again."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from distributed import Client

START_S = 60.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Farm:
    """Processes of dask under a supervisor that starts again what ends, as machines have one."""

    def __init__(self, folder: Path, *, scheme: str = "tcp", env: dict[str, str] | None = None):
        self.folder, self.env = folder, {**os.environ, **(env or {})}
        self.port = free_port()
        self.address = f"{scheme}://127.0.0.1:{self.port}"
        self._commands: dict[str, list[str]] = {}
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._supervisor = threading.Thread(target=self._supervise, daemon=True)
        folder.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> Self:
        self.start("scheduler", "scheduler", "--port", str(self.port))
        self._supervisor.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """End everything for good."""
        self._ended.set()
        self._supervisor.join()
        for name in list(self._running):
            self.kill(name)

    def start(self, name: str, *arguments: str) -> None:
        dask = [sys.executable, "-W", "ignore", "-m", "dask", *arguments, "--no-dashboard"]
        if arguments[0] == "scheduler":
            dask += ["--host", self.address.split("//")[0] + "//127.0.0.1"]
        with self._lock:
            self._commands[name] = dask
            self._spawn(name)

    def add_worker(
        self, name: str, *, threads: int = 1, memory: str = "2GB", preload: str | None = None
    ) -> None:
        more: list[str] = []
        if preload is not None:
            path = self.folder / f"preload_{name}.py"
            path.write_text(preload)
            more = ["--preload", str(path)]
        self.start(
            name,
            *("worker", self.address, "--name", name, "--nthreads", str(threads)),
            *("--memory-limit", memory, "--local-directory", str(self.folder / name)),
            *("--host", "127.0.0.1"),
            *more,
        )

    def wait(self, workers: int) -> None:
        """Wait until so many workers are there."""
        with self.client() as client:
            client.wait_for_workers(workers, timeout=START_S)

    def client(self) -> Client:
        return Client(self.address, timeout=START_S, set_as_default=False)

    def kill(self, name: str) -> None:
        """Kill a process and what it started; the supervisor starts it again."""
        with self._lock:
            process = self._running.pop(name)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def _spawn(self, name: str) -> None:
        with (self.folder / f"{name}.log").open("ab") as log:
            self._running[name] = subprocess.Popen(
                self._commands[name],
                stdout=log,
                stderr=log,
                env=self.env,
                start_new_session=True,
            )

    def _supervise(self) -> None:
        while not self._ended.wait(0.3):
            with self._lock:
                for name in self._commands:
                    process = self._running.get(name)
                    if process is None or process.poll() is not None:
                        self._spawn(name)


def wait_until(happened: object, *, seconds: float = START_S) -> None:
    assert callable(happened)
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.05)
