"""A worker process of a pool, seen from its parent: started, given a capture, ended, replaced.

The processes are plain children with pipes: multiprocessing's spawn would run the caller's main
script again, and its children would outlive a caller that is killed.
"""

import contextlib
import pickle
import subprocess
import sys
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import IO, Final, cast

from camkit.caller import option_text
from camkit.errors import WorkerError
from camkit.runtime.batch.pool_worker import GRACE_S, Order
from camkit.runtime.cancel import Cancel, Cancelled, is_cancelled
from camkit.runtime.development import FileResult
from camkit.runtime.files.decoder import camkit_environment
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.network.tiling import Progress
from camkit.runtime.options import Options
from camkit.runtime.output.claim import claimed

PROCESS: Final = "from camkit.runtime.batch.pool_worker import main; main()"
TRIES: Final = 2
STOPPED: Final = "stopped on request"
Answer = FileResult | Exception | tuple[int, int]
PIPE_ERRORS: Final = (EOFError, OSError, ValueError, pickle.UnpicklingError)
"""Errors of the pipes of a process that has ended."""


@dataclass(slots=True, kw_only=True, eq=False)
class Job:
    """One capture and its caller; what the caller's own functions raise ends it."""

    order: Order
    progress: Progress | None
    cancel: Cancel | None
    future: Future[FileResult] = field(default_factory=Future)
    is_stopped: bool = False
    error: Exception | None = None

    def tell(self, done: int, total: int) -> None:
        """Report progress to the caller."""
        try:
            if self.progress is not None:
                self.progress(done, total)
        except Exception as error:  # noqa: BLE001 - raised by the future
            self.error = error

    def is_unwanted(self) -> bool:
        """Return whether the caller wants the capture to end."""
        try:
            return self.future.cancelled() or self.error is not None or is_cancelled(self.cancel)
        except Exception as error:  # noqa: BLE001 - raised by the future
            self.error = error
            return True

    def finish(self, answer: FileResult | Exception) -> None:
        """End the future, unless its caller has cancelled it."""
        answer = self.error or answer
        if not self.future.set_running_or_notify_cancel():
            return
        if isinstance(answer, Exception):
            self.future.set_exception(answer)
        else:
            self.future.set_result(answer)


class WorkerProcess:
    """A process with its camera, started anew where it has ended; it serves one thread."""

    def __init__(self, setup: tuple[FilePath | None, Options]) -> None:
        self._setup = setup
        self.child = self._start()

    def check_ready(self) -> None:
        """Check that the camera is loaded.

        Raises:
            BundleError: If it is refused; any other error of `camkit.load` likewise.
            WorkerError: If the process ended.
        """
        try:
            answer = self._receive()
        except PIPE_ERRORS:
            raise WorkerError(f"a worker {self.end()} while it loaded the camera") from None
        if isinstance(answer, Exception):
            raise answer

    def make(self, job: Job) -> FileResult | Exception:
        """Return the result of a capture, or what its process raised.

        Raises:
            WorkerError: If the process ended, and the next one did too.
            Cancelled: If it ended and the caller asked to stop.
        """
        how = ""
        for _ in range(TRIES):
            if self.child.poll() is not None:
                self.end()
                self.child = self._start()
                self.check_ready()
            try:
                self.send(job.order)
                while isinstance(answer := self._receive(), tuple):
                    job.tell(*answer)
            except PIPE_ERRORS:
                how = self.end()
            else:
                return _with_note(answer, how)
            if job.is_stopped:
                break
        with contextlib.suppress(OSError), claimed(job.order.target):
            pass  # removes the parts that were left
        if job.is_stopped:
            raise Cancelled(STOPPED)
        raise WorkerError(
            f"{job.order.source.name}: {TRIES} workers ended, the last one {how}; the system may "
            f"lack memory: lower {option_text('max_mem_bytes')} or {option_text('workers')}"
        )

    def send(self, message: object) -> None:
        """Send a message to the process; may be called from any thread."""
        _send(message, self.child)

    def end(self) -> str:
        """End the process, and return how it ended."""
        with contextlib.suppress(*PIPE_ERRORS):
            self.send(None)
        try:
            code = self.child.wait(GRACE_S)
        except subprocess.TimeoutExpired:
            self.child.kill()
            code = self.child.wait()
        with contextlib.suppress(OSError), self.child:
            pass  # closes the pipes
        return f"ended with signal {-code}" if code < 0 else f"ended with exit code {code}"

    def _receive(self) -> Answer:
        return cast("Answer", pickle.load(cast("IO[bytes]", self.child.stdout)))

    def _start(self) -> subprocess.Popen[bytes]:
        child = subprocess.Popen(
            [sys.executable, "-P", "-c", PROCESS],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=camkit_environment(),
            process_group=0,  # an interrupt is for the parent, which then ends the child
        )
        with contextlib.suppress(*PIPE_ERRORS):  # whoever waits for it hears of that
            _send(self._setup, child)
        return child


def _with_note(answer: FileResult | Exception, how: str) -> FileResult | Exception:
    """Return an answer that says how a process ended before, if one did."""
    if not how or isinstance(answer, Exception):
        return answer
    note = f"a first worker {how}; a second one made this capture"
    return replace(answer, warnings=(*answer.warnings, note))


def _send(message: object, child: subprocess.Popen[bytes]) -> None:
    pipe = cast("IO[bytes]", child.stdin)
    pipe.write(pickle.dumps(message))
    pipe.flush()
