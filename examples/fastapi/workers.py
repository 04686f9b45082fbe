"""Worker processes with a camera loaded; what ends one of them ends no capture but its own."""

import asyncio
import multiprocessing
import os
from collections.abc import Awaitable, Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import camkit
from camkit.runtime.development import make_file
from camkit.runtime.write_options import WriteOptions

BUNDLE = os.environ.get("CAMERA", "duet")
CAP_BYTES = 800_000_000  # memory of one worker: enough for 6000x4000 pixels of duet
POLL_S = 0.1
_loaded: dict[str, Any] = {}  # in a worker


def _load(stop: Any, share: Any) -> None:
    camera = camkit.load(BUNDLE, size="S", threads=1, max_mem_bytes=CAP_BYTES)
    _loaded.update(camera=camera, stop=stop, share=share)


def _make(source: Path, picture: Path) -> tuple[str, ...]:
    def count(done: int, total: int) -> None:
        _loaded["share"].value = done / total

    def is_stopped() -> bool:
        return bool(_loaded["stop"].value)

    camera, write = _loaded["camera"], WriteOptions(format="jpeg")
    return make_file(source, picture, camera, write, progress=count, cancel=is_stopped).warnings


class Worker:
    """One process, which makes one capture after the other."""

    def __init__(self) -> None:
        """Start the process; the camera is loaded before its first task."""
        spawn = multiprocessing.get_context("spawn")
        self.stop, self.share = spawn.RawValue("b", 0), spawn.RawValue("d", 0.0)
        self.pool = ProcessPoolExecutor(1, spawn, _load, (self.stop, self.share))


class Workers:
    """Some workers, and the queue of captures before them."""

    def __init__(self, count: int) -> None:
        """Start that many."""
        self._free: asyncio.Queue[Worker] = asyncio.Queue()
        for _ in range(count):
            self._free.put_nowait(Worker())

    async def ready(self) -> None:
        """Wait until every camera is loaded; a bundle that is refused raises here."""
        for _ in range(self._free.qsize()):
            worker = self._free.get_nowait()
            await asyncio.wrap_future(worker.pool.submit(os.getpid))
            self._free.put_nowait(worker)

    def close(self) -> None:
        """End the processes of all free workers."""
        while not self._free.empty():
            self._free.get_nowait().pool.shutdown()

    async def _take(self, is_gone: Callable[[], Awaitable[bool]]) -> Worker:
        """Return the next free worker; a client that leaves meanwhile takes none."""
        while self._free.empty():
            if await is_gone():
                raise camkit.Cancelled("the client left before a worker was free")
            await asyncio.sleep(POLL_S)
        return self._free.get_nowait()

    async def make(
        self,
        source: Path,
        picture: Path,
        progress: Callable[[float], None],
        is_gone: Callable[[], Awaitable[bool]],
    ) -> tuple[str, ...]:
        """Make a picture by the next free worker, which is cancelled when the client is gone.

        Returns:
            What camkit warns of.

        Raises:
            CamkitError: What is wrong with the capture.
            Cancelled: If the client is gone.
            BrokenProcessPool: If two workers ended while they made it.
        """
        worker = await self._take(is_gone)
        job = None
        try:
            for is_last in (False, True):  # the system may have ended one: the capture gets another
                worker.stop.value = False
                worker.share.value = 0.0
                try:
                    job = asyncio.wrap_future(worker.pool.submit(_make, source, picture))
                    while not (await asyncio.wait([job], timeout=POLL_S))[0]:
                        progress(worker.share.value)
                        if await is_gone():
                            worker.stop.value = True
                    return job.result()
                except BrokenProcessPool:
                    worker = Worker()
                    if is_last:
                        raise
        finally:
            if job is None or job.done():
                self._free.put_nowait(worker)
            else:  # the request was cancelled: the worker is free once it has heard of that
                worker.stop.value = True
                job.add_done_callback(lambda _: self._free.put_nowait(worker))
