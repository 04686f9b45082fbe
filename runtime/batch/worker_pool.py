"""Processes with a camera loaded, each making one capture after the other, for services.

submit -> captures that wait -> thread of a worker -> its process (`pool_process`) -> future
             one thread more asks ten times a second which of them shall end
"""

import atexit
import contextlib
import queue
import threading
import time
from concurrent.futures import Future
from os import PathLike
from pathlib import Path
from typing import Self, Unpack

from camkit.bundle.reader import find_bundle
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.field_types import check_value
from camkit.runtime.batch.pool_process import PIPE_ERRORS, STOPPED, Job, WorkerProcess
from camkit.runtime.batch.pool_worker import GRACE_S, STOP, Order
from camkit.runtime.batch.tasks import NO_BUNDLE
from camkit.runtime.cancel import POLL_S, Cancel, Cancelled, check_cancel
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.development import FileResult
from camkit.runtime.face.keywords import LoadKeywords, PictureKeywords
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.network.engine import available_threads
from camkit.runtime.network.tiling import Progress
from camkit.runtime.options import Options, check_names, with_absolute_files, with_choices
from camkit.runtime.output.writer import SUFFIXES
from camkit.runtime.write_options import OTHER_NAMES, WriteOptions


class WorkerPool:
    """Processes with a camera loaded; each makes one capture after the other.

    For services and programs that get captures one by one, from people who may send anything: what
    ends a process ends no capture but its own, and that only if it ends a second one. Safe to share
    between threads. The processes end with the program, also if it is killed.
    """

    def __init__(
        self, bundle: FilePath | None, *, workers: int = 2, **options: Unpack[LoadKeywords]
    ) -> None:
        """Start the processes, and wait until each has its camera.

        Args:
            bundle: Name or path; None develops only.
            workers: Number of processes.
            **options: Those of `camkit.load`. `max_mem_bytes` is the cap of each process; `threads`
                those of each, by default the cores shared among them.

        Raises:
            BundleError: If the bundle is refused.
            ContractError: If an option is wrong, or means nothing to the camera.
            WorkerError: If a process ends while it loads the camera.
        """
        check_value("workers", workers, int)
        check_value("bundle", bundle, str | PathLike | None)
        if workers < 1:
            raise ContractError(f"{option_text('workers')} must be >= 1; got {workers}")
        threads = max(1, available_threads(None) // workers)
        settings = with_choices(Options(threads=threads), options, WorkerPool)
        settings = with_absolute_files(settings)
        if bundle is not None and str(bundle).lower() != NO_BUNDLE:
            bundle = find_bundle(str(bundle)).absolute()
        self._queue: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._jobs: dict[Job, WorkerProcess | None] = {}  # None while one waits
        self._lock, self._has_ended = threading.Lock(), threading.Event()
        self._is_closed = self._is_cancelled = False
        self._workers: list[WorkerProcess] = []
        try:
            for _ in range(workers):
                self._workers.append(WorkerProcess((bundle, settings)))
            for worker in self._workers:
                worker.check_ready()
        except BaseException:
            for worker in self._workers:
                worker.child.kill()
                worker.end()
            raise
        self._threads = [
            threading.Thread(target=self._serve, args=(worker,), name="camkit-pool", daemon=True)
            for worker in self._workers
        ]
        self._watcher = threading.Thread(target=self._watch, name="camkit-pool", daemon=True)
        for thread in (*self._threads, self._watcher):
            thread.start()
        atexit.register(self.close, cancel=True)

    def submit(
        self,
        source: FilePath,
        picture: FilePath,
        *,
        mosaic: MosaicOptions | None = None,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
        **write: Unpack[PictureKeywords],
    ) -> Future[FileResult]:
        """Queue a capture; its picture and its sidecar appear when they are complete.

        Args:
            source: The capture.
            picture: The file to write, whose suffix is that of a format, such as .jpg; its folder
                is made if it is not there.
            mosaic: How to read a headerless mosaic, or levels in place of a RAW file's.
            progress: Called with (work done, work in all) from a thread of the pool; a second try
                begins anew.
            cancel: Asked ten times a second from a thread of the pool, also while the capture
                waits; true ends it.
            **write: Fields of `WriteOptions`, such as jpeg_quality=90 or overwrite=True.

        Returns:
            A future of the result, which carries the warnings; `asyncio.wrap_future` takes it. Its
            `cancel()` works at any time but does not wait for the process to let go of the files,
            as the end of `cancel` does, and its `result` raises `CancelledError` of
            `concurrent.futures` then.

        Raises:
            ContractError: If the pool is closed, or an option is wrong. The future raises what else
                is wrong with the capture, with its options or with the bundle; `Cancelled` if
                `cancel` said so; `WorkerError` if two processes ended over it; and OSError if the
                picture cannot be written.
        """
        check_value("source", source, str | PathLike)
        check_value("picture", picture, str | PathLike)
        check_value("mosaic", mosaic, MosaicOptions | None)
        check_cancel(cancel)
        check_names(write, PictureKeywords.__annotations__.keys(), self.submit)
        target = Path(picture).absolute()
        suffix = target.suffix.lower().removeprefix(".")
        name = OTHER_NAMES.get(suffix, suffix)
        format_ = name if name in SUFFIXES else None
        options = WriteOptions(**{"format": format_, **write})  # type: ignore[arg-type]
        path = Path(source).absolute()
        order = Order(source=path, target=target, write=options, mosaic=mosaic)
        job = Job(order=order, progress=progress, cancel=cancel)
        with self._lock:
            if self._is_closed:
                raise ContractError("the pool is closed")
            self._jobs[job] = None
            self._queue.put(job)
        return job.future

    def close(self, *, cancel: bool = False) -> None:
        """End the processes once all captures are made.

        Args:
            cancel: End the captures that wait or are under way as `cancel` of `submit` does.
        """
        with self._lock:
            self._is_closed = True
            self._is_cancelled |= cancel
        for _ in self._threads:
            self._queue.put(None)
        if cancel:
            end = time.monotonic() + GRACE_S
            for thread in self._threads:
                thread.join(max(0.0, end - time.monotonic()))
            for worker in self._workers:
                worker.child.kill()
        for thread in self._threads:
            thread.join()
        self._has_ended.set()
        self._watcher.join()
        atexit.unregister(self.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            self.close(cancel=kind is not None)
        except BaseException:
            self.close(cancel=True)
            raise

    def _serve(self, worker: WorkerProcess) -> None:
        """Make captures by one worker, one after the other."""
        while (job := self._queue.get()) is not None:
            with self._lock:
                if job not in self._jobs:  # it ended while it waited
                    continue
                self._jobs[job] = worker
            try:
                answer = worker.make(job)
            except Exception as error:  # noqa: BLE001 - raised by the future
                answer = error
            with self._lock:
                del self._jobs[job]
            job.finish(answer)
        worker.end()

    def _watch(self) -> None:
        """End captures whose callers want that."""
        while not self._has_ended.wait(POLL_S):
            with self._lock:
                jobs = list(self._jobs)
            for job in jobs:
                if self._is_cancelled or job.is_unwanted():
                    self._stop(job)

    def _stop(self, job: Job) -> None:
        job.is_stopped = True
        with self._lock:
            worker = self._jobs.get(job)
            is_waiting = job in self._jobs and worker is None
            if is_waiting:
                del self._jobs[job]
            elif worker is not None:
                with contextlib.suppress(*PIPE_ERRORS):
                    worker.send(STOP)  # again and again: a process may have just begun
        if is_waiting:
            job.finish(Cancelled(STOPPED))
