"""The queue of a run on a cluster: kept by the caller, so that nothing is lost with a scheduler."""

import contextlib
import queue
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.caller import language, option_text
from camkit.errors import CamkitError, ContractError
from camkit.runtime.batch.cluster import remote
from camkit.runtime.batch.cluster.connection import NoAnswer
from camkit.runtime.batch.cluster.crew import Crew
from camkit.runtime.batch.cluster.link import Link
from camkit.runtime.batch.cluster.losses import Losses
from camkit.runtime.batch.making import ELSEWHERE, Common, Pipelines
from camkit.runtime.batch.tasks import NO_BUNDLE, Task
from camkit.runtime.cancel import Cancelled, check_cancelled
from camkit.runtime.development import FileResult
from camkit.runtime.options import Options
from camkit.runtime.output.claim import CLAIM_SUFFIX, claimed
from camkit.runtime.output.sidecar import read_sidecar

if TYPE_CHECKING:
    from distributed import Client, Future

POLL_S: Final = 0.1
WAIT_S: Final = 300.0
"""A scheduler that is lost, or workers that are, may take so long to come back."""
TELL_S: Final = 5.0
"""A worker that starts again at once is not worth a word."""
STOP_S: Final = 5.0
"""Files in the making have so long to be given up."""
CLAIMED_S: Final = 30.0
"""A file that somebody else has claimed for so long is left to him."""
LEASE_S: Final = 120.0
"""Where workers were lost he may be one of them: a file server keeps a lock while it waits for the
machine to come back (NFS: 90 s).
"""
LOST_S: Final = 60.0
"""A scheduler that is connected may take so long to answer."""
RETRY_S: Final = 1.0
TRIES: Final = 3
"""Of a file whose task failed for no reason of its own."""
SAMPLE: Final = 3
MARK: Final = ".camkit-run-"
MARK_KEPT_S: Final = 86_400.0
"""A file system without locks would give away those of callers at work."""

Notice = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """The caller's wishes for a run.

    Attributes:
        options: What changes the pixels.
        common: How pictures are written; progress and the wish to stop.
        pipelines: Of this machine; nothing is computed with them.
        on_result: Called with each result as it is ready.
        notice: Called with what concerns no single file.
    """

    options: Options
    common: Common
    pipelines: Pipelines
    on_result: Callable[[FileResult], None] | None
    notice: Notice


def process_on_cluster(client: "Client", tasks: Sequence[Task], wishes: Wishes) -> list[FileResult]:
    """Make the pictures of tasks on the workers of a scheduler.

    Args:
        client: Of dask.distributed, not asynchronous.
        tasks: From `list_tasks`.
        wishes: What the caller wants.

    Returns:
        One result per task, in their order.

    Raises:
        ContractError: If no worker fits, before any work.
        CamkitError: If scheduler or workers are lost and do not come back; what is done stays done.
        Cancelled: If the caller wished so.
    """
    if client.asynchronous:
        raise ContractError("an asynchronous client cannot be waited for; give one that is not")
    run = _Run(client, tasks, wishes)
    with _token(wishes.common.write.out_dir, run.name) as token:
        return run.results(token)


@contextlib.contextmanager
def _token(folder: Path, run: str) -> Iterator[Path]:
    """Write a file beside the pictures by which workers recognise the same folder.

    It is a claim, so that those of callers that were killed are told from those of callers at work.
    """
    folder = folder.absolute()
    for mark in folder.glob(f"{MARK}*{CLAIM_SUFFIX}"):
        with contextlib.suppress(OSError):
            if time.time() - mark.stat().st_mtime > MARK_KEPT_S:
                with claimed(mark.with_suffix("")):
                    pass  # removes it if its caller is no more
    path = folder / f"{MARK}{run}"
    with claimed(path):
        yield path.with_name(path.name + CLAIM_SUFFIX)


class _Run:
    """One run: files that wait, files under way, results."""

    def __init__(self, client: "Client", tasks: Sequence[Task], wishes: Wishes) -> None:
        self.name = uuid.uuid4().hex[:12]
        self._topic = None if wishes.common.progress is None else f"camkit-{self.name}"
        self._link = Link(client, self._topic, self._tell)
        self._tasks, self._wishes = tasks, wishes
        self._results: list[FileResult | None] = [None] * len(tasks)
        self._waiting: deque[int] = deque()
        self._later: deque[tuple[float, int]] = deque()
        self._alone: deque[int] = deque()
        self._open: dict[Future[FileResult | None], int] = {}
        self._finished: queue.SimpleQueue[Future[FileResult | None]] = queue.SimpleQueue()
        self._losses = Losses(tasks)
        self._tries = [0] * len(tasks)
        self._lone: int | None = None
        self._unanswered_s: float | None = None
        self._claimed_s: dict[int, float] = {}
        self._idle_since: float | None = None
        self._told_since: float | None = None
        self._shas: dict[str, str] = {NO_BUNDLE: NO_BUNDLE}
        self._bytes = remote.file_bytes(wishes.options)

    # ------------------------------------------------------------------------------ a run

    def results(self, token: Path) -> list[FileResult]:
        """Make everything."""
        bundles = self._find_bundles()
        for number, task in enumerate(self._tasks):
            if task.refusal is not None:
                self._settle(number, FileResult.failure(task.source, None, task.refusal))
            elif self._results[number] is None:
                self._waiting.append(number)
        needs = remote.Needs(
            run=self.name,
            bundles=tuple(bundles),
            file_bytes=self._bytes,
            token=token,
            sources=tuple(self._tasks[n].source.absolute() for n in list(self._waiting)[:SAMPLE]),
            language=language(),
        )
        self._crew = Crew(needs, bundles, self._wishes.notice)
        try:
            if self._waiting:
                self._begin()
            while self._waiting or self._later or self._alone or self._open:
                check_cancelled(self._wishes.common.cancel)
                self._step()
        except BaseException:
            self._give_up()
            raise
        finally:
            self._end()
        return [result for result in self._results if result is not None]

    def _begin(self) -> None:
        self._crew.look(self._link.client)
        if not self._crew.slots:
            raise ContractError(
                f"no worker of {self._link.address} can make these files"
                if self._crew.unfit
                else f"the scheduler at {self._link.address} has no workers"
            )

    def _step(self) -> None:
        try:
            self._link.check()
            if self._link.is_up:
                if self._crew.look(self._link.client):
                    self._follow()
                self._submit()
                self._unanswered_s = None
        except NoAnswer as error:
            now = time.monotonic()
            if self._unanswered_s is None:
                self._unanswered_s = now
                self._wishes.notice(
                    f"the scheduler at {self._link.address} does not answer; waiting for it"
                )
            if not self._link.is_up or now - self._unanswered_s > LOST_S:
                self._find_again(error)
        except OSError as error:
            self._find_again(error)
        self._collect()
        self._watch()

    def _end(self) -> None:
        with contextlib.suppress(Exception):
            self._crew.dismiss(self._link.client)
        self._link.end()

    # ----------------------------------------------------------------------------- bundles

    def _find_bundles(self) -> dict[str, Callable[[], bytes]]:
        """Find the bundles that tasks name; tasks of one that is refused have failed.

        Returns:
            SHA-256 -> gives the bytes.
        """
        readers: dict[str, Callable[[], bytes]] = {}
        trouble: dict[str, str] = {}
        for number, task in enumerate(self._tasks):
            name = task.bundle
            is_settled = name in self._shas or name in trouble or name.lower() == NO_BUNDLE
            if task.refusal is None and not is_settled:
                try:
                    path = find_bundle(name)
                    sha256 = open_bundle(path).sha256
                except CamkitError as error:
                    trouble[name] = str(error)
                else:
                    self._shas[name] = sha256
                    readers[sha256] = path.read_bytes
            if task.refusal is None and name in trouble:
                self._settle(number, FileResult.failure(task.source, name, trouble[name]))
        return readers

    # ------------------------------------------------------------------------------- files

    def _submit(self) -> None:
        """Submit files, as many as there is room for."""
        now = time.monotonic()
        while self._later and self._later[0][0] <= now:
            self._waiting.append(self._later.popleft()[1])
        room = self._crew.room()
        while self._waiting and len(self._open) < room:
            self._send(self._waiting.popleft())
        if self._alone and not (self._open or self._waiting or self._later) and room:
            self._lone = self._alone.popleft()
            self._send(self._lone)

    def _send(self, number: int) -> None:
        task, wishes = self._tasks[number], self._wishes
        bundle = self._shas[NO_BUNDLE if task.bundle.lower() == NO_BUNDLE else task.bundle]
        order = remote.Order(
            task=replace(
                task,
                source=task.source.absolute(),
                target=task.target.absolute(),
                bundle=bundle,
            ),
            options=wishes.options,
            write=wishes.common.write,
            mosaic=wishes.common.mosaic,
            run=self.name,
            topic=self._topic,
            number=number,
            file_bytes=self._bytes,
            language=language(),
        )
        try:
            future = self._link.client.submit(
                remote.make,
                order,
                key=f"camkit-{self.name}-{number}-{uuid.uuid4().hex[:6]}",
                resources={remote.MEMORY: self._bytes, self._crew.flag: 1},
                pure=False,
            )
        except BaseException:
            self._waiting.appendleft(number)
            raise
        self._open[future] = number
        future.add_done_callback(self._finished.put)

    def _collect(self) -> None:
        """Collect finished files; wait a moment if there are none."""
        try:
            ready = [self._finished.get(timeout=POLL_S)]
        except queue.Empty:
            return
        with contextlib.suppress(queue.Empty):
            while True:
                ready.append(self._finished.get_nowait())
        for future in ready:
            number = self._open.pop(future, None)
            if number is not None:
                self._take(number, future)

    def _take(self, number: int, future: "Future[FileResult | None]") -> None:
        """Finish a file, or queue it again."""
        from distributed import KilledWorker

        if future.status == "finished":
            try:
                result = future.result(timeout=STOP_S)
            except Exception:  # noqa: BLE001 - its worker went with the result: it is made or proved again
                self._requeue(number)
                return
            self._idle_since = None
            if result is None:
                self._wait_for_claim(number)
            else:
                self._settle(number, self._as_asked(number, result))
            return
        error = future.exception(timeout=STOP_S) if future.status == "error" else None
        if isinstance(error, KilledWorker):
            self._losses.add_all(number, was_alone=number == self._lone)
            self._send_again(number)
        elif error is None or isinstance(error, Cancelled):
            self._requeue(number)
        else:
            self._after_error(number, error)

    def _requeue(self, number: int) -> None:
        """Queue a file again that was lost for no reason of its own."""
        self._crew.has_losses = True
        self._claimed_s.pop(number, None)
        self._waiting.append(number)

    def _wait_for_claim(self, number: int) -> None:
        """Try a file again that another process makes: it may be a worker that was lost."""
        task, now = self._tasks[number], time.monotonic()
        start_s = self._claimed_s.setdefault(number, now)
        if now - start_s < (LEASE_S if self._crew.has_losses else CLAIMED_S):
            self._later.append((now + RETRY_S, number))
        elif self._crew.has_losses:
            self._fail(
                number,
                f"{task.target} is claimed by another process, or by a worker that was lost; run "
                f"again with {option_text('resume')}",
            )
        else:
            pipeline = self._wishes.pipelines.get(task.bundle, task.source)
            self._settle(number, FileResult.skip(task.source, task.target, pipeline, ELSEWHERE))

    def _after_error(self, number: int, error: BaseException) -> None:
        self._tries[number] += 1
        if self._tries[number] < TRIES:
            self._later.append((time.monotonic() + RETRY_S, number))
        else:
            self._fail(number, f"{type(error).__name__}: {error}")

    def _fail(self, number: int, error: str) -> None:
        task = self._tasks[number]
        with contextlib.suppress(OSError), claimed(task.target):
            pass  # sweeps up what workers that died have left
        bundle = None if task.bundle.lower() == NO_BUNDLE else task.bundle
        self._settle(number, FileResult.failure(task.source, bundle, error))

    def _as_asked(self, number: int, result: FileResult) -> FileResult:
        """Return a result under the names that the caller gave."""
        task = self._tasks[number]
        bundle = result.bundle
        if bundle is not None and result.status == "failed":
            bundle = task.bundle
        output = None if result.output is None else task.target
        extra_files = tuple(task.target.with_name(path.name) for path in result.beside)
        result = replace(
            result, input=task.source, output=output, beside=extra_files, bundle=bundle
        )
        return self._told_late(result) if ELSEWHERE in result.warnings else result

    def _told_late(self, result: FileResult) -> FileResult:
        """Return the result of a picture that was there already when it was asked for again.

        Where workers were lost it was made by one of them, which could not tell: its sidecar does.
        """
        with contextlib.suppress(OSError, NoAnswer):
            self._crew.look(self._link.client, now=True)
        record = None if result.output is None else read_sidecar(result.output)
        if record is None or not self._crew.has_losses:
            return result
        return replace(
            result,
            status="ok",
            seconds=record["seconds"],
            peak_rss_mb=record["peak_rss_mb"],
            warnings=tuple(record["warnings"]),
        )

    def _settle(self, number: int, result: FileResult) -> None:
        self._results[number] = result
        if self._wishes.on_result is not None:
            self._wishes.on_result(result)

    # ------------------------------------------------------------------------------ losses

    def _follow(self) -> None:
        """Withdraw files that no worker has, or that should be tried alone."""
        pending = {str(f.key): f for f in self._open if f.status == "pending"}
        under_way = {key: self._open[future] for key, future in pending.items()}
        for key in self._losses.follow(self._crew.tasks_by_worker(self._link.client), under_way):
            number = self._open.pop(pending[key])
            pending[key].release()
            self._send_again(number)

    def _send_again(self, number: int) -> None:
        """Queue a file again that lost its worker; one that lost several is tried alone."""
        self._claimed_s.pop(number, None)
        fate = self._losses.fate(number)
        if fate == "failed":
            self._fail(
                number,
                "the workers that made it died, in the end with no other file under way; it may "
                "need more memory than a worker has",
            )
        elif fate == "alone":
            self._alone.append(number)
        else:
            self._waiting.appendleft(number)

    def _find_again(self, error: Exception) -> None:
        """Connect anew to a scheduler that was lost, while there is time."""
        if self._told_since is None or self._told_since != self._idle_since:
            self._idle_since = self._told_since = time.monotonic()
            self._wishes.notice(
                f"the scheduler at {self._link.address} is lost ({error}); waiting for it"
            )
        with contextlib.suppress(Exception):
            for future in self._open:
                future.release()
        self._waiting.extendleft(sorted(self._open.values(), reverse=True))
        self._open.clear()
        self._claimed_s.clear()
        self._unanswered_s = None
        self._crew.forget()
        if not self._link.is_up:
            self._link.find_again()

    def _watch(self) -> None:
        """End the run if it has had neither scheduler nor workers for too long.

        Raises:
            CamkitError: If so.
        """
        if self._crew.slots and self._link.is_up:
            self._idle_since = None
            return
        now = time.monotonic()
        if self._idle_since is None:
            self._idle_since = now
        elif now - self._idle_since > TELL_S and self._told_since != self._idle_since:
            self._told_since = self._idle_since
            subject = "no worker of" if self._link.is_up else "the scheduler at"
            self._wishes.notice(f"{subject} {self._link.address} answers; waiting for it")
        if now - self._idle_since > WAIT_S:
            count = len(self._waiting) + len(self._later) + len(self._alone) + len(self._open)
            raise CamkitError(
                f"neither scheduler nor workers came back within {WAIT_S:.0f} s; {count} file(s) "
                f"are left: run again with {option_text('resume')}"
            )

    def _give_up(self) -> None:
        """Cancel all files under way; wait until the workers have released them."""
        with contextlib.suppress(Exception):
            self._link.client.cancel(list(self._open), force=True)
            end = time.monotonic() + STOP_S
            while time.monotonic() < end and self._crew.busy(self._link.client):
                time.sleep(POLL_S)

    # ---------------------------------------------------------------------------- progress

    def _tell(self, event: tuple[float, Any]) -> None:
        number, count, total = event[1]
        progress = self._wishes.common.progress
        if progress is not None and self._results[number] is None:
            progress(self._tasks[number].source, count, total)
